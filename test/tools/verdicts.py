# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Helpers that look up the findings of a report on a synthetic drive."""

from drives import Drive

from omnibot_driver.tools.report.findings import Finding, Level
from omnibot_driver.tools.report.judge import judge


def said(drive: Drive, subject: str, *words: str) -> Finding:
    """Return the only finding of this subject whose text contains all these words."""
    (found,) = [
        finding
        for finding in judge(drive.log())
        if finding.subject == subject and all(word in finding.text for word in words)
    ]
    return found


def troubles(drive: Drive) -> list[Finding]:
    """Return the findings that are worse than a note."""
    return [finding for finding in judge(drive.log()) if finding.level > Level.NOTE]
