# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the driver accepts no recording (``replay://``) as the port of a MART controller.

They also check that no description of a parameter names ``replay://``.
"""

import pytest

from omnibot_driver import boards
from omnibot_driver.core.errors import ParameterError


@pytest.mark.parametrize("port", ["replay://field", "REPLAY://field?speed=10"])
def test_a_recording_is_refused_with_what_to_do_instead(port: str) -> None:
    """A recording is rejected as the parameter ``port`` of a MART controller.

    A replay does not repeat the driver's requests, on which the odometry depends. The error message
    names two other uses of the recording.
    """
    with pytest.raises(ParameterError) as refusal:
        boards.check_all({"board": "mart", "port": port})
    assert str(refusal.value).startswith(f"port '{port}' is not valid: ")
    for other in ("`ros2 bag play`", "`ros2 run omnibot_driver report`"):
        assert other in str(refusal.value)


def test_no_parameter_offers_a_replay() -> None:
    """Nothing in the parameters of a MART controller names ``replay://``."""
    rows = boards.load("mart").PARAMETERS.rows
    assert not [row.name for row in rows if "replay" in row.description]
