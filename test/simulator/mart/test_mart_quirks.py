# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that each quirk of the simulated MART server can be observed, and can be switched off.

A quirk is a deviation from the manual; a function named after a quirk detects it. F, B and RM are
drives, R and L spins, TF and MCR controlled moves. SM and SRM are stops; SL and SS are stops on the
stop port.
"""

from collections.abc import Callable
from dataclasses import fields, replace

import pytest
from mart_rig import INCH_M, Rig

from omnibot_driver.simulator.mart import DOCUMENTED, FIRMWARE, SOURCE, Kind, Quirks

CONFLICT = "fail conflicting action in progress"
IN_SOURCE_ALONE = (
    "heading_in_reference_moves_only",
    "probe_turns",
    "heading_starts_off",
    "corrects_after_stop",
)


def stop_port_keeps_motion(quirks: Quirks) -> bool:
    """Return whether the server keeps a drive (F) in progress after SL (stop port) has stopped it.

    If so, the server refuses other motions, and the stop SM makes the command port hang.
    """
    rig = Rig(quirks)
    rig.drive("F")
    rig.stop("SL")
    rig.run(2.0)
    assert not rig.moving
    conflict = rig.ask("R SLOW") == CONFLICT
    if not conflict:
        return False
    rig.say("SM")
    return rig.wait() is None and rig.server.hung


def spin_stop_ends_drives(quirks: Quirks) -> bool:
    """Return whether SS, the stop of spins, also stops a drive (F)."""
    rig = Rig(quirks)
    rig.drive("F")
    rig.stop("SS")
    rig.run(1.0)
    return not rig.moving


def early_stop_is_ignored(quirks: Quirks) -> bool:
    """Return whether the server ignores the stop SL before it has acknowledged a drive (F)."""
    rig = Rig(quirks)
    rig.say("F")
    rig.run(0.1)
    rig.stop("SL")
    return rig.wait() == "ok" and rig.run(3.0) == [] and rig.moving


def left_spin_in_reference_move(quirks: Quirks) -> bool:
    """Return whether the spin L is accepted during a forward drive (RM).

    The robot then spins, and the server no longer answers.
    """
    rig = Rig(quirks)
    rig.drive("RM 30")
    if rig.ask("L") == CONFLICT:
        return False
    chassis = rig.server.chassis
    return rig.server.hung and chassis.right_mps > 0 > chassis.left_mps


def moves_wait_for_imu(quirks: Quirks) -> bool:
    """Return whether the reply and the motion of a drive (F) wait until a missing IMU is back."""
    rig = Rig(quirks, imu_dies_s=0.0, imu_returns_s=60.0)
    rig.say("F")
    answer = rig.wait(59.0)
    assert rig.server.chassis.way_m == 0.0
    return answer is None and rig.wait(5.0) == "ok" and rig.moving


def drives_trust_imu(quirks: Quirks) -> bool:
    """Return whether a forward drive (RM) without an IMU moves the robot, but is not answered."""
    rig = Rig(quirks, imu_dies_s=0.0)
    silent = rig.ask("RM 30") is None
    return silent and rig.moving


def reference_speed_wraps(quirks: Quirks) -> bool:
    """Return whether a forward drive (RM) with a negative speed, -20, drives backward."""
    rig = Rig(quirks)
    return rig.ask("RM -20") == "ok" and rig.server.chassis.right_mps < 0


def reference_start_counts_on(quirks: Quirks) -> bool:
    """Return whether a forward drive (RM) fails if it directly follows a stop (SRM) of 0.57 s.

    If so, the RM has continued the sample count of the stop. A second RM must succeed.
    """
    rig = Rig(quirks)
    rig.drive("RM 66")
    assert rig.ask("SRM") == "ok"
    failed = rig.ask("RM 30") == "fail "
    assert rig.run(1.0) == []
    assert rig.moving is not failed
    if failed:
        assert rig.ask("SRM") == "fail no motion in progress"
        assert rig.ask("RM 30") == "ok"
    return failed


def speed_word_first(quirks: Quirks) -> bool:
    """Return whether SLOW has no effect in TF 24 SLOW, where it follows the distance."""
    rig, normal = Rig(quirks), Rig(quirks)
    rig.ask("TF 24 SLOW")
    normal.ask("TF 24")
    return rig.took_s == normal.took_s


def zero_distance_is_unlimited(quirks: Quirks) -> bool:
    """Return whether the straight move TF 0, with the distance zero, drives without end."""
    rig = Rig(quirks)
    return rig.ask("TF 0", 60.0) is None and rig.moving


def echoes_distance(quirks: Quirks) -> bool:
    """Return whether the reply to a move of 12 inches is 12, although 16 inches were driven."""
    rig = Rig(quirks)
    answer = rig.ask("TF 12")
    assert round(rig.x_in) == 16
    return answer == "ok 12"


def crashes_on_missing_numbers(quirks: Quirks) -> bool:
    """Return whether the command TIME crashes the server if one of its numbers is missing."""
    rig = Rig(quirks)
    return rig.ask("TIME 7 4 2024 12 30") is None and bool(rig.server.crashed)


def crashes_early(quirks: Quirks) -> bool:
    """Return whether the voltage query (VOLTS) crashes a server that has just started."""
    rig = Rig(quirks)
    rig.server.restart(boot_s=0.0)
    early = rig.ask("VOLTS")
    rig.server.restart(boot_s=0.0)
    rig.run(1.0)
    assert rig.ask("VOLTS") == "ok 24.00"
    return early is None


def empty_datagram_ends(quirks: Quirks) -> bool:
    """Return whether requests after an empty datagram are not answered."""
    rig = Rig(quirks)
    rig.say("")
    return rig.ask("HELLO") is None


def exit_is_silent(quirks: Quirks) -> bool:
    """Return whether the server does not answer EXIT, the command that ends the server.

    A server with this quirk answers EXIT only if LOG (begin a log) was sent before. This function
    does not send LOG.
    """
    return Rig(quirks).ask("EXIT") is None


def log_deletes_files(quirks: Quirks) -> bool:
    """Return whether a new log (LOG) deletes the last file, so LAST TURN cannot download it."""
    rig = Rig(quirks)
    rig.ask("MCR SLOW 20")
    rig.ask("LOG")
    rig.say("LAST TURN")
    return rig.run(0.1) == ["fail"]


def unknown_reset_repeats(quirks: Quirks) -> bool:
    """Return whether RST with an unknown word repeats the previous reply, here a voltage."""
    rig = Rig(quirks)
    rig.ask("VOLTS")
    return rig.ask("RST x") == "ok 24.00"


def clock_moves_heading(quirks: Quirks) -> bool:
    """Return whether the heading jumps when the clock is set ahead by an hour during a turn."""
    rig = Rig(quirks)
    rig.ask("TIME 1 1 2024 0 0 0")
    rig.drive("RM 30")
    rig.ask("RMCS 5 -5")
    rig.run(1.0)
    rig.ask("TIME 1 1 2024 1 0 0")
    return abs(rig.number("RMRA")) > 1000.0


def undocumented_commands(quirks: Quirks) -> bool:
    """Return whether the server understands TFSFC, an undocumented command."""
    return Rig(quirks).ask("TFSFC 30") == "ok"


def heading_in_reference_moves_only(quirks: Quirks) -> bool:
    """Return whether the reported heading (RMRA) does not change in a spin."""
    rig = Rig(quirks)
    rig.drive("R")
    return rig.number("RMRA") == 0.0


def probe_turns(quirks: Quirks) -> bool:
    """Return whether, with a dead IMU, the IMU check MCR SLOW 0 turns the robot."""
    rig = Rig(quirks, imu_dies_s=0.0)
    assert rig.ask("MCR SLOW 0") == "fail MPU6050 connection lost"
    assert rig.took_s == pytest.approx(0.5, abs=0.05)
    return abs(rig.yaw_deg) > 5.0


def heading_starts_off(quirks: Quirks) -> bool:
    """Return whether a second forward drive, long after the first, begins with a wrong heading.

    The right heading at the beginning of a drive is zero.
    """
    rig = Rig(quirks)
    for _ in range(2):
        rig.drive("RM 30", 0.0)
        first = rig.number("RMRA")
        rig.ask("SRM")
        rig.run(1000.0)
    return abs(first) > 5.0


def corrects_after_stop(quirks: Quirks) -> bool:
    """Return whether, after the end of a straight move, the robot still turns a little.

    This does not happen after every move, so up to forty moves are tried.
    """
    rig = Rig(quirks, dead_zone_units=0.0)
    for _ in range(40):
        assert rig.ask("TF 12").startswith("ok")
        rig.run(0.5)
        before = rig.yaw_deg
        rig.run(2.0)
        if abs(rig.yaw_deg - before) > 0.5:
            return True
    return False


SEEN: dict[str, Callable[[Quirks], bool]] = {
    name: found
    for name, found in globals().items()
    if name in {field.name for field in fields(Quirks)}
}


def test_every_quirk_has_its_sight() -> None:
    """Every quirk of the simulated server has a detector."""
    assert set(SEEN) == {field.name for field in fields(Quirks)}


@pytest.mark.parametrize("name", SEEN)
def test_a_quirk_is_seen_with_it_and_unseen_without(name: str) -> None:
    """A detector finds its quirk if this quirk is on, and does not find it if this quirk is off.

    In both cases, the other quirks of the firmware are on.
    """
    assert SEEN[name](replace(FIRMWARE, **{name: True}))
    assert not SEEN[name](replace(FIRMWARE, **{name: False}))


@pytest.mark.parametrize("name", SEEN)
def test_a_quirk_is_unseen_on_a_server_as_documented(name: str) -> None:
    """A server that follows the manual has no quirks. No detector finds a quirk on it."""
    assert not SEEN[name](DOCUMENTED)


@pytest.mark.parametrize("name", IN_SOURCE_ALONE)
def test_what_only_the_source_says_is_played_only_if_it_is_asked_for(name: str) -> None:
    """Some quirks are only in the published source.

    They are on only in the variant that imitates this source.
    """
    assert SEEN[name](SOURCE)
    assert not SEEN[name](FIRMWARE)


def test_by_the_source_a_spin_stop_leaves_a_drive_alone() -> None:
    """In the published source, SS (stop of spins) has no effect on a drive (F).

    SM ends the drive as usual.
    """
    rig = Rig(SOURCE)
    rig.drive("F")
    rig.stop("SS")
    rig.run(1.0)
    assert rig.moving
    assert rig.ask("SM") == "ok"


@pytest.mark.parametrize("text", ["CS 5", "SFR", "SRR", "MCS 100", "TIME 1"])
def test_a_server_without_crashes_says_that_a_number_is_missing(text: str) -> None:
    """The quirk ``crashes_on_missing_numbers`` is off. A command has too few numbers.

    The server does not crash. It replies that the command's format is wrong, and it still answers
    HELLO.
    """
    rig = Rig(replace(FIRMWARE, crashes_on_missing_numbers=False))
    if text == "CS 5":
        rig.drive("F")
    assert rig.ask(text) == "fail improper command format"
    assert rig.ask("HELLO") == "ok BBB"


def test_a_documented_server_stops_at_a_wall() -> None:
    """A server that follows the manual stops the robot before the robot hits a wall."""
    for start, stop, answer in (
        ("F", "SM", "fail insufficent clearence"),
        ("RM 30", "SRM", "fail insufficient clearance"),
    ):
        rig = Rig(DOCUMENTED, front_m=45 * INCH_M)
        rig.drive(start, 10.0)
        assert not rig.moving
        assert not rig.server.hit_wall
        assert rig.ask(stop) == answer


def test_a_documented_server_stops_when_its_imu_dies() -> None:
    """The IMU dies during a motion. A server that follows the manual stops the robot."""
    for start in ("F", "RM 30", "R"):
        rig = Rig(DOCUMENTED, imu_dies_s=1.0)
        rig.drive(start, 5.0)
        assert not rig.moving
        assert rig.ask("SRM" if start == "RM 30" else "SM") == "fail MPU6050 connection lost"


def test_a_documented_move_is_cancelled_at_any_time() -> None:
    """On a server that follows the manual, a stop ends a controlled move at any time.

    The reply to the move comes within 1 s of the stop.
    """
    for start, stop in (("TF 100", "SL"), ("TB 100", "SL"), ("MCR 170", "SS"), ("MCL 170", "SS")):
        for after_s in (0.02, 0.12, 1.0):
            rig = Rig(DOCUMENTED)
            rig.say(start)
            rig.run(after_s)
            rig.stop(stop)
            assert rig.wait(1.0) is not None
            rig.run(1.0)
            assert not rig.moving
            assert rig.in_progress is None
            assert rig.server.motions[Kind.CONTROLLED_LINEAR].posts == 0


def test_by_the_source_a_probe_of_a_living_imu_turns_the_robot_a_little() -> None:
    """In the published source, the check of the IMU (MCR SLOW 0) turns the robot a little.

    It turns to the right by 1 to 2.5 degrees.
    """
    rig = Rig(SOURCE)
    for probes in (1, 2, 3):
        assert rig.ask("MCR SLOW 0") == "ok"
        assert -2.5 < rig.yaw_deg / probes < -1.0
