# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of boards that restart: short and long boots, with or without the start line.

A board sends this line at the end of its boot.
"""

import contextlib
import itertools
import random

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.messages import BoardPose
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.fejemis.sums import with_sum
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware

RESTARTS = [
    (boot_s, read_s, (n + m) % 2 == 0)
    for n, boot_s in enumerate((0.0, 0.4))
    for m, read_s in enumerate((0.001, 0.02, 0.1))
]
"""Cases of a restart: duration of the boot in s, time between two reads in s, and whether the board
sends its start line."""


def assert_odometry_is_right(bench: Bench, within_m: float) -> None:
    truth = bench.robot.truth
    off = bench.odometry[-1].pose.way_to(Pose(truth.x_m, truth.y_m, truth.yaw_rad))
    assert off.way_m < within_m
    assert abs(off.yaw_rad) < 0.02


def test_a_pose_before_the_start_line_in_one_read_belongs_to_the_time_before_the_restart() -> None:
    """If one read contains a pose and then the report of a restart, the pose is handled first.

    Afterwards, the driver resets its estimate of the board's clock.
    """
    bench = nominal()
    drive = bench.robot.drive
    pose = with_sum(drive._pose().encode("ascii")) + b"\n"
    start = with_sum(b"# Starting main loop") + b"\n"
    poses: list[BoardPose] = []
    readings = bench.board._translation.odometry.readings
    bench.board._translation.odometry.readings = (  # type: ignore[method-assign]
        lambda pose: (poses.append(pose), readings(pose))[1]
    )
    bench.session.inbound.receive(pose + start, bench.now, DRIVE)
    assert [one.time_s for one in poses] == [pytest.approx(drive.clock_s, abs=0.001)]
    assert bench.board._translation.odometry._pose is None
    assert not bench.board._ports.halves[DRIVE].clock.known


@pytest.mark.slow
@pytest.mark.parametrize("boot_s", [0.002, 0.05])
def test_a_restart_at_any_phase_of_the_reads_is_survived(boot_s: float) -> None:
    """The odometry does not jump if the drive board restarts at any time between two reads.

    A read may contain poses from before and from after the restart.
    """
    bench = nominal(Simulated(boot_s=boot_s))
    bench.read_s = 0.02
    for phase in range(5):
        bench.drive_on(0.3, 0.2, 0.3)
        bench.run(0.004 * phase)
        bench.robot.drive.reboot()
        bench.run(0.2)
        bench.run_until(lambda: bench.session.state == "nominal")
        bench.run(0.7)
        assert bench.robot.standing
        assert bench.robot.drive.subscriptions["pose"] == 20
    assert any("drive board has restarted" in text for text in bench.notices)
    places = [estimate.pose for estimate in bench.odometry]
    assert max(a.way_to(b).way_m for a, b in itertools.pairwise(places)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("boot_s", "read_s", "says_start"), RESTARTS)
@pytest.mark.parametrize("half", ["drive", "front"])
def test_every_restart_stops_the_robot_and_is_reported(
    half: str, boot_s: float, read_s: float, *, says_start: bool
) -> None:
    """A restart of a board during a slow drive is reported, and stops the robot.

    If the board sends no line that reports it, the times in its other lines show the restart.
    """
    bench = nominal(
        Simulated(boot_s=boot_s, firmware=Firmware(says_start=says_start)),
        commands=CommandSettings(timeout_s=60.0),
    )
    bench.run(1.0)
    bench.drive_on(0.05)  # slowly, as the drive board does not report its last motion
    assert not bench.robot.standing
    bench.read_s = read_s
    before = dict(bench.robot.half(half).subscriptions)
    bench.robot.half(half).reboot()
    bench.run(0.8)
    bench.run_until(lambda: any(f"{half} board has restarted" in text for text in bench.notices))
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.3)
    assert bench.robot.standing
    assert bench.robot.half(half).subscriptions == before
    assert_odometry_is_right(bench, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("away_s", [0.5, 6.0])
def test_a_restart_while_the_port_is_away_is_noticed_even_if_the_uptime_has_grown(
    away_s: float,
) -> None:
    """A restart while the port is away is detected, and the odometry does not jump.

    The port comes back ``away_s`` seconds after the restart. The board's uptime may then be shorter
    or longer than before.
    """
    bench = nominal()
    bench.drive_on(0.3, 0.0, 1.5)
    bench.run(1.0)
    before = bench.odometry[-1].pose
    bench.close()
    bench.speaks = bench.hears = set()
    bench.robot.drive.reboot()
    bench.run(away_s)
    bench.speaks, bench.hears = {DRIVE, FRONT}, {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    assert before.way_to(bench.odometry[-1].pose).way_m < 0.02
    assert any("drive board has restarted" in text for text in bench.notices)
    assert not any("front board has restarted" in text for text in bench.notices)


@pytest.mark.slow
def test_a_restart_is_noticed_although_the_computer_stalled_while_the_port_was_away() -> None:
    """A board restarts while its port is away, and the computer stalls meanwhile.

    The driver detects the restart by the board's time, and the odometry does not jump.
    """
    bench = nominal()
    bench.drive_on(0.3, 0.0, 3.0)
    bench.run(1.5)
    before = bench.odometry[-1].pose
    bench.close()
    bench.speaks = bench.hears = {FRONT}
    bench.open(missing="the port 'drive' is missing")
    bench.robot.drive.reboot()
    bench.run(4.0)
    bench.session.stood_still(0.5, bench.now)
    bench.run(4.0)
    bench.close()
    bench.speaks = bench.hears = {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    assert before.way_to(bench.odometry[-1].pose).way_m < 0.02
    assert any("drive board has restarted" in text for text in bench.notices)


@pytest.mark.slow
def test_a_port_that_was_away_for_long_is_no_restart() -> None:
    """The ports are away for longer than the boards had run before. No board restarts.

    So the driver does not report a restart.
    """
    bench = nominal()
    bench.close()
    bench.speaks = bench.hears = set()
    bench.run(8.0)
    bench.speaks, bench.hears = {DRIVE, FRONT}, {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    assert not any("restarted" in text for text in bench.notices)


FRONT_OFFSET = {Written.FRONT_WHEEL: (3.0, 0.0)}


def drive_through_a_restart(bench: Bench, half: str) -> list[str]:
    """Restart a board while motion is commanded; return the reasons why commands were refused.

    Also check that the robot drives again only after the front board is configured.
    """
    robot, refusals = bench.robot, []
    bench.drive_on(0.3, 0.0, 0.5)
    robot.half(half).reboot()
    began, driven_s = bench.now, 0.0
    while driven_s < 0.5 and bench.now < began + 6.0:
        try:
            bench.drive(0.3)
        except CommandRefused as refused:
            refusals.append(str(refused))
        if robot.drive.reference[0] and bench.now > began + 0.15:
            assert robot.front.config.angle_offset_deg == 3.0, bench.now - began
            driven_s += 0.02
        bench.run(0.02)
    assert not robot.standing
    assert any(f"{half} board has restarted" in text for text in bench.notices)
    return refusals


@pytest.mark.slow
@pytest.mark.parametrize(("boot_s", "read_s", "says_start"), RESTARTS)
def test_a_front_board_that_restarts_is_not_driven_before_it_is_configured(
    boot_s: float, read_s: float, *, says_start: bool
) -> None:
    """The front board restarts and loses the user's settings.

    Motion is refused until the driver has written them again.
    """
    bench = nominal(
        Simulated(boot_s=boot_s, firmware=Firmware(says_start=says_start)),
        FejemisSettings(written=FRONT_OFFSET),
    )
    bench.run(0.5)
    bench.read_s = 0.05 if read_s == 0.1 else read_s  # an angle of 60 ms is too old to drive
    refusals = drive_through_a_restart(bench, "front")
    if not says_start:
        assert any("may have restarted" in text for text in refusals)


def test_a_heartbeat_from_before_the_pause_does_not_rule_out_a_restart() -> None:
    """The front board is silent, and may have restarted. An old heartbeat arrives late.

    Only a heartbeat that was sent after the silence ends the driver's uncertainty.
    """
    bench = nominal()
    bench.run(2.0)
    half, front = bench.board._ports.halves[FRONT], bench.robot.front
    old = with_sum(front._items["hbt"]().encode("ascii")) + b"\n"
    bench.speaks = {DRIVE}
    bench.run_until(lambda: half.unsure)
    bench.session.inbound.receive(old, bench.now, FRONT)
    assert half.unsure
    new = with_sum(front._items["hbt"]().encode("ascii")) + b"\n"
    bench.session.inbound.receive(new, bench.now, FRONT)
    assert not half.unsure


@pytest.mark.slow
@pytest.mark.parametrize("half", ["drive", "front"])
@pytest.mark.parametrize("pause_s", [0.9, 2.0])
def test_the_robot_is_not_nominal_while_a_restart_cannot_be_ruled_out(
    half: str, pause_s: float
) -> None:
    """After a silence, the state becomes ``nominal`` only after a heartbeat of the board.

    The heartbeat shows whether the board has restarted.
    """
    bench = nominal()
    bench.speaks = {FRONT if half == "drive" else DRIVE}
    bench.run(pause_s)
    assert any(half.unsure for half in bench.board._ports.halves)
    bench.speaks = {DRIVE, FRONT}
    bench.run(0.02)
    bench.run_until(lambda: bench.session.state == "nominal")
    assert not any(half.unsure for half in bench.board._ports.halves)
    bench.drive_on()
    assert not bench.robot.standing


def test_the_heartbeat_is_requested_ten_times_a_second_after_a_pause() -> None:
    """After a board was silent, the driver requests its heartbeat ten times a second.

    The board itself sends it only every 0.4 s.
    """
    bench = nominal()
    bench.speaks = {DRIVE}
    bench.run_until(lambda: bench.board._ports.halves[FRONT].unsure)
    mark = bench.now
    bench.run(0.5)
    assert bench.lines(FRONT, mark).count("hbti") == pytest.approx(5, abs=1)
    bench.speaks = {DRIVE, FRONT}
    mark = bench.now
    bench.run_until(lambda: not bench.board._ports.halves[FRONT].unsure)
    assert bench.now - mark < 0.13


@pytest.mark.slow
@pytest.mark.parametrize("read_s", [0.001, 0.05])
def test_lost_lines_and_late_reads_do_not_make_a_board_suspect(read_s: float) -> None:
    """One line in twenty is lost for 5 s. The driver does not suspect a restart of a board."""
    bench = nominal()
    chance = random.Random(3)

    def carry(_: int, data: bytes) -> bytes:
        lines = data.splitlines(keepends=True)
        return b"".join(line for line in lines if chance.random() >= 0.05)

    bench.carry, bench.read_s = carry, read_s
    for _ in range(50):
        with contextlib.suppress(CommandRefused):  # the angle may be too old for a moment
            bench.drive(0.2)
        bench.run(0.1)
        assert not any(half.unsure for half in bench.board._ports.halves)
    assert not any("restarted" in text for text in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize("stall_s", [0.3, 0.7, 1.2])
def test_a_stall_of_the_computer_is_not_a_long_suspicion(stall_s: float) -> None:
    """The computer stalls. At most 0.25 s after the stall, the driver accepts commands again.

    By then, heartbeats have shown that no board has restarted.
    """
    bench = nominal()
    bench.run(2.0)
    read_s, bench.read_s = bench.read_s, stall_s
    bench.run(stall_s + 0.1)
    bench.read_s = read_s
    bench.run(0.15)
    assert not any(half.unsure for half in bench.board._ports.halves)
    bench.drive(0.3)
    bench.run(0.3)
    assert not bench.robot.standing
    assert not any("restarted" in text for text in bench.notices)
