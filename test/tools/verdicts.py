# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a report says of a drive made of numbers."""

from drives import Drive

from omnibot_driver.tools.report.findings import Finding, Level
from omnibot_driver.tools.report.judge import judge


def said(drive: Drive, subject: str, *words: str) -> Finding:
    """The one finding of this subject that has these words."""
    (found,) = [
        finding
        for finding in judge(drive.log())
        if finding.subject == subject and all(word in finding.text for word in words)
    ]
    return found


def troubles(drive: Drive) -> list[Finding]:
    """The findings that are worse than a note."""
    return [finding for finding in judge(drive.log()) if finding.level > Level.NOTE]
