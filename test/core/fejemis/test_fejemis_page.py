# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the two tables that list all commands and all subscriptions in the boards' help."""

import math
import re
from dataclasses import dataclass

import pytest
from fejemis_bench import DRIVE, FRONT, ask, nominal
from test_fejemis_lines import GOLDEN

from omnibot_driver.core.fejemis.angle_relay import AngleRelay
from omnibot_driver.core.fejemis.codec import parse
from omnibot_driver.core.fejemis.configuration import ASKED as CONFIGURED
from omnibot_driver.core.fejemis.half import STREAMS
from omnibot_driver.core.fejemis.machine import lift_line
from omnibot_driver.core.fejemis.motion_lines import STOP
from omnibot_driver.core.fejemis.polls import ASKED as POLLED
from omnibot_driver.core.fejemis.readings import Job
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.fejemis.help_text import DRIVE_HELP, FRONT_HELP


@dataclass(frozen=True)
class Row:
    """One command that the boards accept.

    ``golden``: an example line with the command.

    ``use``: the topic, service, parameter or diagnostic key that needs the command.

    ``by``: what the driver does instead; empty if it sends the command.
    """

    golden: str
    use: str
    by: str = ""


NONE = "none: "
BUS = f"{NONE}set-up of the servo bus, which the steering controller uses"
DEBUG = f"{NONE}debug print"
SAID: dict[str, Row] = {
    "rc": Row("rc 2 0 0", "topic cmd_vel"),
    "fwl": Row("fwl 10.40", "relayed to drive"),
    "confs": Row("confs 0.4 0.42", "parameters track, steering_distance"),
    "stop": Row("stop", "services ~/estop, ~/pause"),
    "start": Row("start", "services ~/start, ~/estop"),
    "off": Row("off 10", "service ~/power_off"),
    "on": Row("on", "service ~/start calls a power off back"),
    "leave": Row("leave", "when a board is found: ends the subscriptions of other programs"),
    "gyroc": Row("gyroc", "service ~/calibrate_gyro"),
    "acccal2": Row("acccal2", "service ~/calibrate_accelerometer"),
    "magcal": Row("magcal 1 2 3 1 0 0 0 1 0 0 0 1", "parameter mag_calibration"),
    "acccal": Row("acccal 0.1 0.2 0.3 1 1 1", "parameter accel_calibration"),
    "confw": Row("confw 0.08 0.081 20 48 0.41", "parameters wheel_radii, gear, encoder_ticks"),
    "hcsr": Row("hcsr", "topic range/sonar"),
    "eew": Row("eew", "service ~/save_configuration"),
    "eer": Row("eer", "service ~/load_configuration"),
    "brush": Row("brush 1", "service ~/brush"),
    "ledb": Row("ledb 255 128 0", "topic led_cmd"),
    "ledon": Row("ledon 1", "topic led_cmd"),
    "leds": Row("leds", "topic led_cmd, given back at the end"),
    "led": Row("led 0 255 128 0", "topic led_cmd", by="ledb, all twelve with one line"),
    "motv": Row("motv 5.9 .499", "topic lift_cmd"),
    "irc": Row("irc 40000 13000 41000 12000", "parameter ir_calibration"),
    "fwoffset": Row("fwoffset 2.5 0", "parameters front_wheel_offset, front_wheel_inverted"),
    "cssteer": Row("cssteer 1 40 0 0 0 1 1 0.15 0.05", "parameter steering_gains"),
    "sub": Row("sub fwl 15", "whatever is subscribed"),
    "enc0": Row("enc0", "service ~/reset_odometry", by="an origin that the driver keeps"),
    "log": Row("log pose 1", DEBUG),
    "pds": Row("pds", DEBUG),
    "read": Row("read 1", DEBUG),
    "help": Row("help", f"{NONE}help"),
    "setid": Row("setid 90", f"{NONE}setid, as 0 erases the board"),
    "setname": Row("setname drive", "diagnostics id", by="idi, which reads the name"),
    "pwmf": Row("pwmf 15000", f"{NONE}pwmf"),
    "svp": Row("svp 512 0", BUS),
    "svv": Row("svv 0 0", BUS),
    "svat": Row("svat 0", BUS),
    "svar": Row("svar 0", BUS),
    "svjt": Row("svjt 0", BUS),
    "svb": Row("svb 115200", BUS),
    "svscan": Row("svscan 0", BUS),
}
HEARD: dict[str, str] = {
    "hbt": "identity, ~/state, restarts, diagnostics",
    "id": "diagnostics id",
    "ver": "diagnostics ver",
    "adc": "diagnostics adc",
    "int": "diagnostics int",
    "time": "diagnostics time",
    "amp": "diagnostics amp",
    "cur": "diagnostics cur",
    "bat": "topic battery_state of drive, diagnostics bat of both",
    "cvdrive": "diagnostics cvdrive",
    "cpdrive": "diagnostics cpdrive",
    "cvsteer": "diagnostics cvsteer",
    "cpsteer": "parameter steering_gains, diagnostics cpsteer",
    "confs": "parameters track, steering_distance, diagnostics confs",
    "conf": "parameters of the wheels, diagnostics conf",
    "gyro": "topic imu/data_raw",
    "acc": "topic imu/data_raw",
    "gyroo": "service ~/calibrate_gyro, diagnostics gyroo",
    "acco": "service ~/calibrate_accelerometer, diagnostics acco",
    "mag": "topic imu/mag",
    "magw": "diagnostics magw",
    "mago": "parameter mag_calibration, diagnostics mago",
    "imupose": "topic imu/data",
    "enc": "diagnostics enc",
    "pose": "topic odom",
    "vel": "topic odom",
    "tofd": "topic range/tof",
    "tof1": "diagnostics tof1",
    "sr04": "topic range/sonar",
    "ir": "topics range/ir1, range/ir2, parameter ir_calibration",
    "mot": "diagnostics mot",
    "svp": "diagnostics svp",
    "svjt": "diagnostics svjt",
    "fwl": "joint_states, relayed to drive",
    "fwo": "parameters front_wheel_offset, front_wheel_inverted, diagnostics fwo",
}


def listed(text: str) -> tuple[set[str], set[str]]:
    """Return the commands and the subscriptions that a help list contains."""
    said, heard = set(), set()
    for line in text.splitlines():
        if not line.startswith("  "):
            continue
        words = line.split()
        if found := re.search(r"'sub (\w+) N'", line):
            heard.add(found[1])
        else:
            said.add(words[0])
    return said, heard


@pytest.mark.parametrize("text", [DRIVE_HELP, FRONT_HELP], ids=["drive", "front"])
def test_every_line_of_the_help_lists_has_a_row(text: str) -> None:
    """Each command in the boards' help is in the table of commands, ``SAID``.

    Each subscription in the help is in the table of messages, ``HEARD``.
    """
    said, heard = listed(text)
    assert said <= SAID.keys()
    assert heard <= HEARD.keys()
    assert len(said) > 15
    assert len(heard) > 15


def test_no_row_is_of_something_else() -> None:
    """The help texts of the boards list each command and each message in the driver's tables.

    The only exception is ``sub``, the command that subscribes to messages.
    """
    drive, front = listed(DRIVE_HELP), listed(FRONT_HELP)
    assert SAID.keys() - {"sub"} <= drive[0] | front[0]
    assert HEARD.keys() <= drive[1] | front[1]


@pytest.mark.parametrize("keyword", HEARD)
def test_every_message_has_a_golden_line_and_is_asked_for(keyword: str) -> None:
    """Each message has an example line in the table of golden lines.

    The driver subscribes to the message, polls it regularly, or requests it with the configuration.
    """
    golden = [text for text in GOLDEN if text.split()[0] == keyword]
    assert golden
    assert parse(golden[0]) is not None
    asked = {key for streams in STREAMS.values() for key in streams}
    asked |= {
        t.decode()[:-1] for table in (CONFIGURED, POLLED) for ts in table.values() for t in ts
    }
    assert keyword in asked


@pytest.mark.slow
def test_every_message_is_a_stream_or_shown_in_diagnostics() -> None:
    """The driver subscribes to some messages as streams. The diagnostics show all other messages.

    An example is the front board's battery message, ``bat``.
    """
    bench = nominal()
    bench.run(6.5)
    shown = bench.board.figures.own
    for half, text in (("drive", DRIVE_HELP), ("front", FRONT_HELP)):
        for keyword in listed(text)[1] - STREAMS[half].keys():
            assert f"{half.capitalize()} {keyword}" in shown


def said_by_the_driver() -> set[str]:
    """Return all lines that the driver sends in a session in which a user requests everything.

    Example lines of a relayed angle and of a lift voltage are added.
    """
    written: dict[Written, tuple[float, ...]] = {
        Written.WHEELS: (0.08, 0.081, 20.0, 48.0, 0.41),
        Written.STEERING: (0.4, 0.42),
        Written.FRONT_WHEEL: (2.5, 0.0),
        Written.INFRARED: (40000.0, 13000.0, 41000.0, 12000.0),
        Written.MAGNETOMETER: (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        Written.ACCELEROMETER: (0.1, 0.2, 0.3, 1.0, 1.0, 1.0),
        Written.STEERING_GAINS: (1.0, 40.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.15, 0.05),
    }
    bench = nominal(settings=FejemisSettings(written=written))
    bench.board.services.set_brush(True, bench.now)
    bench.board.services.set_led(255, 128, 0, bench.now)
    bench.settle()
    # A parameter that sets the accelerometer's offsets would forbid its calibration.
    bench.board.settings = FejemisSettings()
    for job in Job:
        ask(bench, job)
    bench.estop(True)
    bench.estop(False)
    bench.session.request(Request.START, None, bench.now)
    bench.settle()
    bench.written += [(bench.now, channel, data) for channel, data in bench.board.switch_off()]
    said = {text for channel in (DRIVE, FRONT) for text in bench.lines(channel)}
    said |= {
        AngleRelay().text(math.radians(10.4), sums=True).decode(),
        lift_line(6.0, 0.5)[0].decode(),
    }
    return said


@pytest.mark.slow
def test_every_command_is_said_as_its_golden_line_or_never() -> None:
    """The driver sends each used command in ``SAID`` as in its example line.

    Only ``motv`` (lift) may have other numbers. Unused and replaced commands are never sent; one of
    them, ``setid``, can erase the board.
    """
    said = said_by_the_driver()
    assert STOP.decode() == SAID["rc"].golden
    words = {text.split()[0] for text in said}
    for keyword, row in SAID.items():
        if row.use.startswith(NONE) or row.by:
            assert keyword not in words, keyword
        elif keyword == "motv":
            assert any(text.startswith("motv") for text in said)
        else:
            assert row.golden in said, row
    asked = {key for streams in STREAMS.values() for key in streams}
    assert {text.split()[1] for text in said if text.startswith("sub ")} == asked
