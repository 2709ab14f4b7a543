"""The mode table in docs/architecture.md is the one in the code."""

from pathlib import Path

from omnibot_driver.core.board import Mode
from omnibot_driver.core.omnibot.modes import TRANSITIONS

DOCUMENT = Path(__file__).parents[2] / "docs" / "architecture.md"


def test_the_documented_mode_table_is_the_one_in_the_code() -> None:
    """Drawn from the table and compared line by line."""
    modes = list(Mode)
    lines = ["| | " + " | ".join(mode.value for mode in modes) + " |", "|---|---|---|---|---|"]
    for happening, after in TRANSITIONS.items():
        cells = [after[mode].value if mode in after else "refused" for mode in modes]
        lines.append(f"| {happening.value} | " + " | ".join(cells) + " |")
    _, _, rest = DOCUMENT.read_text(encoding="utf-8").partition("<!-- modes: begin -->\n")
    documented, _, _ = rest.partition("<!-- modes: end -->")
    assert documented.splitlines() == lines
