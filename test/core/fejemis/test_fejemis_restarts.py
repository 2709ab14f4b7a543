# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A board that restarts: short and long boots, lost start lines, and reads of several lengths."""

import itertools

import pytest
from fejemis_bench import DRIVE, Bench, nominal

from omnibot_driver.core.fejemis.messages import BoardPose
from omnibot_driver.core.fejemis.sums import with_sum
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware


def assert_odometry_is_right(bench: Bench, within_m: float) -> None:
    truth = bench.robot.truth
    off = bench.odometry[-1].pose.way_to(Pose(truth.x_m, truth.y_m, truth.yaw_rad))
    assert off.way_m < within_m
    assert abs(off.yaw_rad) < 0.02


def test_a_pose_before_the_start_line_in_one_read_belongs_to_the_time_before_the_restart() -> None:
    """Messages are handled one by one, so the pose is used before the restart resets its clock."""
    bench = nominal()
    drive = bench.robot.drive
    pose = with_sum(drive._pose().encode("ascii")) + b"\n"
    start = with_sum(b"# Starting main loop") + b"\n"
    poses: list[BoardPose] = []
    readings = bench.board._translation.odometry.readings
    bench.board._translation.odometry.readings = (  # type: ignore[method-assign]
        lambda pose, now: (poses.append(pose), readings(pose, now))[1]
    )
    bench.session.inbound.receive(pose + start, bench.now, DRIVE)
    assert [one.time_s for one in poses] == [pytest.approx(drive.clock_s, abs=0.001)]
    assert bench.board._translation.odometry._pose is None
    assert not bench.board._ports.halves[DRIVE].clock.known


@pytest.mark.parametrize("boot_s", [0.002, 0.05])
def test_a_restart_at_any_phase_of_the_reads_is_survived(boot_s: float) -> None:
    """Each read brings the lines of 20 ms, so poses before a restart come with its start line."""
    bench = nominal(Simulated(boot_s=boot_s))
    bench.read_s = 0.02
    for phase in range(10):
        bench.drive_on(0.3, 0.2, 0.3)
        bench.run(0.002 * phase)
        bench.robot.drive.reboot()
        bench.run(0.2)
        bench.run_until(lambda: bench.session.state == "nominal")
        bench.run(1.2)
        assert bench.robot.standing
        assert bench.robot.drive.subscriptions["pose"] == 20
    assert any("drive board has restarted" in text for text in bench.notices)
    places = [estimate.pose for estimate in bench.odometry]
    assert max(a.way_to(b).way_m for a, b in itertools.pairwise(places)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("read_s", [0.001, 0.02, 0.1])
@pytest.mark.parametrize("boot_s", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("says_start", [True, False])
@pytest.mark.parametrize("half", ["drive", "front"])
def test_every_restart_stops_the_robot_and_is_reported(
    half: str, boot_s: float, read_s: float, *, says_start: bool
) -> None:
    """Without the start line, the board's time shows the restart; the robot then drives again."""
    bench = nominal(Simulated(boot_s=boot_s, firmware=Firmware(says_start=says_start)))
    bench.run(2.0)
    bench.read_s = read_s
    before = dict(bench.robot.half(half).subscriptions)
    bench.robot.half(half).reboot()
    bench.run(1.0)
    bench.run_until(lambda: any(f"{half} board has restarted" in text for text in bench.notices))
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.5)
    assert bench.robot.standing
    assert bench.robot.half(half).subscriptions == before
    assert_odometry_is_right(bench, 0.02)
