# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the boards' configuration: the driver reads it, and writes what the user has set."""

import itertools

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, Firmware, nominal

from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.codec import parse
from omnibot_driver.core.fejemis.configuration import Configuration
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.fejemis.steering import Geometry
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated

WRITTEN: dict[Written, tuple[float, ...]] = {
    Written.WHEELS: (0.08, 0.081, 20.0, 48.0, 0.41),
    Written.STEERING: (0.41, 0.43),
    Written.FRONT_WHEEL: (2.5, 0.0),
    Written.INFRARED: (40000.0, 13000.0, 41000.0, 12000.0),
    Written.MAGNETOMETER: (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    Written.ACCELEROMETER: (0.1, 0.2, 0.3, 1.0, 1.0, 1.0),
    Written.STEERING_GAINS: (1.0, 40.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.15, 0.05),
}


def test_only_what_the_user_set_is_written() -> None:
    """The user has set nothing, so nothing is written. The diagnostics show the boards' values."""
    bench = nominal()
    bench.run(3.0)
    words = {text.split()[0] for channel in (DRIVE, FRONT) for text in bench.lines(channel)}
    assert not words & {setting.value for setting in Written}
    assert "setid" not in words
    own = bench.board.figures.own
    assert own["Drive conf"] == "0.0775 0.0775 19 68 0.4"
    assert own["Front confs"] == "0.42 0.4"
    assert own["Drive ver"].startswith("110")
    assert own["Front id"] == "front 91"


@pytest.mark.slow
@pytest.mark.parametrize("sums", [True, False])
def test_what_the_user_set_is_written_read_back_and_written_again_after_a_restart(
    *, sums: bool
) -> None:
    """The driver writes each of the user's values to its board, and reads it back.

    After a restart of the boards, it writes all values again.
    """
    from omnibot_driver.simulator.fejemis import Firmware

    bench = nominal(Simulated(firmware=Firmware(sums=sums)), FejemisSettings(written=WRITTEN))
    bench.run(1.0)
    for restarts in range(2):
        if restarts:
            bench.robot.drive.reboot()
            bench.robot.front.reboot()
            bench.run(2.5)
        drive, front = bench.robot.drive.config, bench.robot.front.config
        assert drive.radii_m == (0.08, 0.081)
        assert (drive.gear, drive.ticks, drive.wheel_base_m) == (20.0, 48.0, 0.41)
        assert drive.confs_m == front.confs_m == (0.41, 0.43)
        assert front.angle_offset_deg == 2.5
        assert front.ir == (40000.0, 13000.0, 41000.0, 12000.0)
        assert front.steering[:2] == (1.0, 40.0)
        assert bench.board.geometry.track_m == 0.41
        mark = bench.now
        bench.run(2.0)
        written = {setting.value for setting in Written}
        assert not written & {text.split()[0] for text in bench.lines(FRONT, mark)}
        assert bench.board.advice is None


@pytest.mark.slow
def test_a_board_that_does_not_keep_a_value_is_told_of() -> None:
    """The user sets an impossible radius, which the board does not keep.

    A notice names the setting that the board does not keep.
    """
    bench = nominal(settings=FejemisSettings(written={Written.WHEELS: (0.08, -1.0, 1.0, 1.0, 1.0)}))
    bench.run(4.0)
    assert any("confw" in text for text in bench.notices)


def test_the_order_of_the_steering_geometry_is_found_out() -> None:
    """The driver must find the order in which ``confs`` contains track width and wheelbase.

    Another message of the board, ``conf``, has the track width, but not the wheelbase. The driver
    compares the two messages.
    """
    for turned in (False, True):
        configuration = Configuration("drive", {})
        for _ in range(2):
            configuration.hear(parse("conf 0.0775 0.0775 19 68 0.4000 0.001"))
            configuration.hear(parse("confs 0.4000 0.4200" if turned else "confs 0.4200 0.4000"))
        assert configuration.geometry == Geometry(track_m=0.4, wheelbase_m=0.42)


def test_a_board_is_driven_by_the_geometry_that_it_reports_not_by_what_it_did_not_take() -> None:
    """The board does not accept the geometry that the user has set.

    The driver uses the user's geometry only until the board has reported its own.
    """
    configuration = Configuration("drive", {Written.STEERING: (0.35, 0.45)})
    wanted, reported = Geometry(0.35, 0.45), Geometry(0.4, 0.42)
    assert configuration.geometry == wanted
    for text, expected in (("confs 0.4200 0.4000", reported), ("confs 0.4500 0.3500", wanted)):
        configuration.hear(parse(text))
        configuration.hear(parse(text))
        assert configuration.geometry == expected


def test_a_reading_is_believed_once_it_was_read_twice_alike() -> None:
    """The driver uses a geometry only after the board has reported it twice in a row.

    1 in 99 damaged lines passes its checksum.
    """
    configuration = Configuration("drive", {})
    for text in ("confs 0.4200 0.4000", "confs 4.2 0.4000", "confs 0.4200 0.4000"):
        configuration.hear(parse(text))
        assert configuration.geometry is None
    configuration.hear(parse("confs 0.4200 0.4000"))
    assert configuration.geometry == Geometry(track_m=0.4, wheelbase_m=0.42)
    configuration.hear(parse("confs 4.2 0.4000"))
    assert configuration.geometry == Geometry(track_m=0.4, wheelbase_m=0.42)


def test_what_was_read_once_is_asked_for_again() -> None:
    """The driver queries a value exactly twice: the second report confirms the first one."""
    bench = nominal()
    bench.run(2.0)
    assert bench.lines(DRIVE).count("confi") == 2
    assert "conf" in bench.board._upkeep.configurations["drive"].told


def test_what_was_written_and_read_once_is_not_written_again() -> None:
    """The driver has written a value, and has read it back once.

    It queries the value a second time, but it does not write it a second time.
    """
    bench = nominal(settings=FejemisSettings(written={Written.STEERING: (0.41, 0.43)}))
    bench.run(2.0)
    assert bench.lines(FRONT).count("confs 0.41 0.43") == 1
    assert bench.board._upkeep.configurations["front"].told["confs"] == (0.43, 0.41)


@pytest.mark.slow
def test_a_small_change_by_the_user_is_written() -> None:
    """The user changes a setting very little. The driver still writes it."""
    first, second = (0.0775, 0.0775, 19.0, 68.0, 0.4), (0.0772, 0.0778, 19.0, 68.0, 0.4)
    bench = nominal(settings=FejemisSettings(written={Written.WHEELS: first}))
    bench.run(1.0)
    mark = bench.now
    bench.board.settings = FejemisSettings(written={Written.WHEELS: second})
    bench.run(3.0)
    assert bench.robot.drive.config.radii_m == (0.0772, 0.0778)
    assert bench.lines(DRIVE, mark).count("confw 0.0772 0.0778 19 68 0.4") == 1
    assert bench.board.figures.own["Drive conf"].startswith("0.0772 0.0778")


@pytest.mark.slow
def test_a_small_change_whose_line_is_damaged_is_written_again() -> None:
    """A line that changes a radius by 0.3 mm and is damaged on its way is written again.

    The board reports radii with four decimals, enough to notice this.
    """
    first, second = (0.0775, 0.0775, 19.0, 68.0, 0.4), (0.0772, 0.0778, 19.0, 68.0, 0.4)
    bench = nominal(settings=FejemisSettings(written={Written.WHEELS: first}))
    bench.run(1.0)
    receive, damaged = bench.robot.receive, []

    def damage(data: bytes, now: float, channel: int) -> None:
        if b"confw" in data and not damaged:
            damaged.append(data)
            data = data.replace(b"confw", b"canfw")
        receive(data, now, channel)

    bench.robot.receive = damage  # type: ignore[method-assign]
    bench.board.settings = FejemisSettings(written={Written.WHEELS: second})
    bench.run(2.0)
    assert damaged
    assert bench.robot.drive.config.radii_m == (0.0772, 0.0778)
    assert bench.board.advice is None


@pytest.mark.parametrize(
    ("text", "agrees"),
    [
        ("conf 0.0772 0.0778 19 68 0.4000 0.002", True),
        ("conf 0.077 0.078 19.00 68 0.400 0.002", True),
        ("conf 0.0773 0.0778 19 68 0.4000 0.002", False),
        ("conf 0.0772 0.0778 19 68 0.5 0.002", False),
    ],
)
def test_a_number_counts_as_written_if_only_the_boards_rounding_hides_it(
    text: str, *, agrees: bool
) -> None:
    """A value counts as written if only the board's rounding changes it."""
    configuration = Configuration("drive", {Written.WHEELS: (0.07724, 0.07776, 19.0, 68.0, 0.4)})
    configuration.due(0.0, stands=True)
    for _ in range(2):
        configuration.hear(parse(text))
    assert configuration.pending is not agrees


@pytest.mark.slow
def test_a_small_change_while_the_robot_is_driven_is_written_once_it_stands() -> None:
    """The user changes a setting while the robot is driven.

    The driver writes the setting to the board when the robot rests.
    """
    bench = nominal(settings=FejemisSettings(written={Written.STEERING: (0.4, 0.42)}))
    bench.drive_on()
    bench.board.settings = FejemisSettings(written={Written.STEERING: (0.4, 0.4205)})
    bench.drive_on(seconds=1.0)
    assert bench.robot.drive.config.confs_m == (0.4, 0.42)
    bench.run(2.0)
    assert bench.robot.drive.config.confs_m == (0.4, 0.4205)
    assert bench.robot.front.config.confs_m == (0.4, 0.4205)


def test_a_small_difference_is_written_after_a_start() -> None:
    """When the driver starts, the board's values differ only slightly from the user's settings.

    The driver writes the settings.
    """
    configuration = Configuration("front", {Written.STEERING: (0.4, 0.4205)})
    for _ in range(2):
        configuration.hear(parse("confs 0.4200 0.4000"))
    assert configuration.pending
    assert b"confs 0.4 0.4205" in configuration.due(0.0, stands=True)
    for _ in range(2):
        configuration.hear(parse("confs 0.4205 0.4000"))
    assert not configuration.pending


@pytest.mark.slow
def test_a_damaged_line_without_a_sum_changes_no_setting() -> None:
    """A query or subscription without a checksum loses one or two characters.

    The remaining characters never form a command that changes a setting of the board.
    """
    bench = nominal(Simulated(firmware=Firmware(sums=False)))
    bench.run(8.0)
    texts = {text for channel in (DRIVE, FRONT) for text in bench.lines(channel)}
    asked = {text for text in texts if text.startswith("sub ") or text.endswith("i")}
    assert len(asked) > 30
    for text in asked:
        for count in (1, 2):
            for kept in itertools.combinations(text, len(text) - count):
                word = "".join(kept).split(" ")[0]
                assert not word.startswith((*(one.value for one in Written), "sv", "set")), text


def test_a_setting_of_sums_that_the_lines_contradict_is_told_of() -> None:
    """The user's setting for checksums is wrong, so the driver rejects all lines except heartbeats.

    A notice says that the heartbeats contradict the setting.
    """
    bench = Bench(settings=FejemisSettings(line_sums="off"))
    bench.open()
    bench.run(4.0)
    assert bench.session.state == "connecting"
    assert any("come with checksums" in text for text in bench.notices)


def test_a_board_that_is_not_known_yet_is_named_by_its_port() -> None:
    """A line contradicts the user's setting for checksums before the first heartbeat.

    The advice names the board at whose port the line came.
    """
    board = FejemisBoard(FejemisSettings(line_sums="on"))
    board.connect()
    board.receive(b"pose 1.0 0.0 0.0 0.0\n", 1000.0, DRIVE)
    assert "the lines of the drive board come without checksums" in (board.advice or "")


def test_boards_with_different_geometries_are_told_of() -> None:
    """The two boards have different geometries, so one computes wrong speeds or angles.

    A notice says so.
    """
    bench = nominal()
    bench.robot.receive(b"confs 0.4 0.5\n", bench.now, FRONT)
    bench.session.closed(bench.now)
    bench.open()
    bench.run(4.0)
    assert any("different steering geometries" in text for text in bench.notices)


def test_a_robot_is_not_driven_before_it_has_what_the_user_set() -> None:
    """Motion is refused until the board has all settings that the user has set.

    A line with a setting may be lost, and the driver sends a setting again only while the robot is
    at rest.
    """
    settings = FejemisSettings(written={Written.STEERING: (0.35, 0.44)})
    bench = Bench(settings=settings)
    bench.open()
    bench.hears = set()
    bench.board._upkeep.configurations["front"].told["confs"] = 0.5, 0.4
    assert "being written" in bench.board.refusal
    bench.board.settings = FejemisSettings(written={Written.STEERING: (0.35, 0.45)})
    assert "being written" in bench.board.refusal
    bench.hears = {DRIVE, FRONT}
    bench.run_until(lambda: not bench.board._upkeep.configurations["front"].pending)
    bench.run(0.5)
    bench.drive_on()
    assert not bench.robot.standing
    assert bench.board._upkeep.configurations["front"].told["confs"] == (0.45, 0.35)
