# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes the report as files: pictures, and one HTML page that contains them."""

import base64
import html
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Final

from matplotlib.figure import Figure

from omnibot_driver.tools.report import commanded, plots
from omnibot_driver.tools.report.findings import Finding, Level, headline, span
from omnibot_driver.tools.report.log import Log

DPI: Final = 110
WORDS: Final = {Level.BAD: "wrong", Level.WARN: "look", Level.NOTE: "note", Level.GOOD: "good"}

Draw = Callable[[Log], Figure]

PICTURES: Final[tuple[tuple[str, str, Draw, Callable[[Log], int], str], ...]] = (
    (
        "timeline",
        "What happened",
        plots.timeline,
        lambda log: len(log.states) + len(log.diagnostics),
        "Bands over time. Diagnostics: green is OK, yellow WARN, red ERROR, grey STALE. In the"
        " pictures below, red shading shows a latched e-stop. Other shading shows a state in which"
        " the board does not run.",
    ),
    (
        "path",
        "Path",
        plots.path,
        lambda log: int(log.odom.finite.sum()),
        "The robot's path by the odometry.",
    ),
    (
        "velocities",
        "Velocities",
        plots.velocities,
        lambda log: len(commanded.shown(log)[0].measured),
        "A command is drawn until the next one, but for at most 0.5 s (the default of"
        " cmd_vel_timeout). After this time the picture shows zero.",
    ),
    (
        "imu",
        "IMU",
        plots.inertia,
        lambda log: int(log.imu.finite.sum()),
        "The published values, in the sensor's own axes. Of a long recording, only the largest and"
        " the smallest values in each short time are drawn.",
    ),
    (
        "spectrum",
        "Spectrum of the IMU",
        plots.spectra,
        lambda log: int(log.imu.finite.sum()) // 100,
        "Noise at rest should be flat; peaks in motion come from rollers, axles and motors.",
    ),
    (
        "timing",
        "Timing",
        plots.timing,
        lambda log: max(len(log.imu), len(log.odom)) // 10,
        "Stamps should be exactly one period apart. Late arrival does not change a stamp.",
    ),
)

STYLE: Final = """
body{font:15px/1.5 system-ui,sans-serif;color:#1d2329;background:#f4f5f7;margin:0}
main{max-width:1060px;margin:0 auto;padding:24px 20px 60px}
h1{font-size:26px;margin:0}
h2{font-size:19px;margin:34px 0 4px}
p{margin:4px 0 10px}
.about,.advice,th{color:#59636e}
.card{background:#fff;border:1px solid #dfe3e8;border-radius:8px;padding:14px 18px}
.headline{font-size:20px;font-weight:600;margin:18px 0 12px;border-left:6px solid}
.bad{border-color:#c0272d}
.warn{border-color:#e0a100}
.good,.note{border-color:#3d9970}
table{border-collapse:collapse;width:100%}
td,th{padding:7px 10px;text-align:left;vertical-align:top}
th{font-weight:600}
tr+tr td{border-top:1px solid #e8ebee}
.tag{display:inline-block;min-width:48px;text-align:center;border-radius:4px;padding:0 6px;
color:#fff;font-size:13px}
.tag.bad{background:#c0272d}
.tag.warn{background:#b97f00}
.tag.note{background:#59708a}
.tag.good{background:#3d9970}
img{width:100%;height:auto;display:block}
"""


def write(log: Log, findings: Sequence[Finding], source: str, folder: Path) -> Path:
    """Write pictures (PNG) and report.html into the folder; return the path of report.html."""
    folder.mkdir(parents=True, exist_ok=True)
    sections = []
    for name, title, draw, enough, explanation in PICTURES:
        file = folder / f"{name}.png"
        file.unlink(missing_ok=True)
        if enough(log) < 2:
            continue
        image = png(draw(log))
        file.write_bytes(image)
        sections.append(_section(name, title, explanation, image))
    page = folder / "report.html"
    page.write_text(_page(log, findings, source, sections), encoding="utf-8")
    return page


def png(figure: Figure) -> bytes:
    """Return a figure as PNG data."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def text(findings: Sequence[Finding]) -> str:
    """Return the findings as text for a terminal."""
    lines = [headline(findings), ""]
    for finding in findings:
        lines.append(f"{WORDS[finding.level]:5} {finding.subject:11} {finding.text}")
        if finding.advice:
            lines.append(f"{'':17} > {finding.advice}")
    return "\n".join(lines)


def _section(name: str, title: str, explanation: str, image: bytes) -> str:
    data = base64.b64encode(image).decode("ascii")
    return (
        f'<h2 id="{name}">{title}</h2><p class="about">{html.escape(explanation)}</p>'
        f'<div class="card"><img alt="{title}" src="data:image/png;base64,{data}"></div>'
    )


def _page(log: Log, findings: Sequence[Finding], source: str, sections: Sequence[str]) -> str:
    worst = max((finding.level for finding in findings), default=Level.GOOD).name.lower()
    begin = datetime.fromtimestamp(log.start_ns / 1e9, tz=UTC)
    rows = "".join(map(_row, findings))
    about = (
        f"{html.escape(source)} · robot {html.escape(log.robot)} · {begin:%Y-%m-%d %H:%M:%S} UTC ·"
        f" {span(log.duration_s)} · {len(log.imu)} imu/data_raw, {len(log.odom)} odom,"
        f" {len(log.cmd_vel)} cmd_vel"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>OmniBot drive report</title><style>{STYLE}</style></head><body><main>"
        f'<h1>OmniBot drive report</h1><p class="about">{about}</p>'
        f'<div class="card headline {worst}">{headline(findings)}</div>'
        '<div class="card"><table><tr><th></th><th>Subject</th>'
        "<th>What was found, and what to do</th></tr>"
        f"{rows}</table></div>{''.join(sections)}</main></body></html>\n"
    )


def _row(finding: Finding) -> str:
    advice = f'<div class="advice">{html.escape(finding.advice)}</div>' if finding.advice else ""
    kind = finding.level.name.lower()
    return (
        f'<tr><td><span class="tag {kind}">{WORDS[finding.level]}</span></td>'
        f"<td>{finding.subject}</td><td>{html.escape(finding.text)}{advice}</td></tr>"
    )
