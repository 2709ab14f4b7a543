# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated controller itself: time, copies, seeds, networks and options."""

import copy
import random
import time

import pytest
from mart_rig import Rig

from omnibot_driver.simulator import mart
from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults
from omnibot_driver.simulator.common.serving import ServedBoard
from omnibot_driver.simulator.common.wired import WiredBoard
from omnibot_driver.transports.simulated import SimulatedTransport
from omnibot_driver.transports.udp import UdpPorts

TEXTS = (
    *("F", "B SLOW", "R", "L", "RM 30", "RM 200", "TF 4", "TB 0", "MCR 20", "MCL SLOW 5"),
    *("CS 4 -4", "RMCS 4 -4", "SM", "SRM", "ENC", "RMRA", "VOLTS", "SFC", "SB", "LOG", "TIME 1"),
    *("LAST MOVE", "RST IMU", "MCS 100 100", "MSM", "", "x", "EXIT"),
)


def walk(rig: Rig, seed: int, steps: int) -> None:
    """Send random requests and stops. Sometimes switch the IMU off or on, or restart the server."""
    dice = random.Random(seed)
    for _ in range(steps):
        rig.run(dice.choice((0.0, 0.01, 0.1, 0.5, 2.0)))
        what = dice.random()
        if what < 0.7:
            rig.say(dice.choice(TEXTS[:-2] if dice.random() < 0.9 else TEXTS))
        elif what < 0.85:
            rig.stop(dice.choice(("SL", "SS", "SDR 5")))
        elif what < 0.9:
            rig.server.imu.alive = not rig.server.imu.alive
        elif rig.server.crashed:
            rig.server.restart()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(15))
def test_whatever_is_said_time_goes_on_and_a_copy_goes_the_same_way(seed: int) -> None:
    """A server is copied in the middle of random requests.

    Server and copy then receive the same requests, and give the same replies.
    """
    rig = Rig(seed=seed, front_m=3.0, rear_m=3.0)
    walk(rig, seed, 40)
    twins = [rig.server.copy(), copy.deepcopy(rig.server)]
    began, now = len(rig.replies), rig.now
    walk(rig, seed + 1000, 40)
    ours = rig.replies[began:]
    for server in twins:
        twin = Rig()
        twin.server = server
        assert twin.now == now
        walk(twin, seed + 1000, 40)
        assert twin.replies == ours
        assert twin.server.chassis.__dict__ == rig.server.chassis.__dict__


def test_the_size_of_the_steps_does_not_matter() -> None:
    """The same requests are simulated in time steps of 1 ms, 13 ms and 2 s.

    The replies are the same.
    """
    found = []
    for step_s in (0.001, 0.013, 2.0):
        rig = Rig(motor_inequality=0.03)
        for text in ("RM 30", "RMCS 5 -5", "SRM", "TF 6", "MCL 40", "ENC"):
            rig.say(text)
            until_s = rig.now + 4.0
            while rig.now < until_s - 1e-9:
                rig.run(min(step_s, until_s - rig.now))
        found.append(([data for _, data in rig.replies], rig.server.chassis.x_m, rig.yaw_deg))
    assert found[0] == found[1] == found[2]


def test_it_runs_faster_than_a_hundredth_of_real_time_even_while_it_drives() -> None:
    """A simulated drive of 100 s needs less than 1 s of processor time, usually about 0.1 s."""
    rig = Rig()
    rig.drive("RM 30")
    began = time.process_time()
    rig.run(100.0)
    assert time.process_time() - began < 1.0


def test_a_robot_that_stands_costs_nothing_as_time_passes() -> None:
    """A year at rest is simulated in one step."""
    rig = Rig()
    assert rig.server.wake_at == float("inf")
    rig.run(3e7)
    assert rig.ask("HELLO") == "ok BBB"


def test_a_bad_network_loses_doubles_and_reorders_by_its_seed() -> None:
    """A bad network loses, doubles and reorders datagrams in both directions.

    The seed determines which datagrams.
    """

    def talk(seed: int) -> tuple[list[bytes], list[bytes]]:
        faults = NetworkFaults(lose=0.2, duplicate=0.2, delay_s=0.3)
        wired = WiredBoard(
            mart.SimulatedMart(), [FaultyNetwork(faults, f"{seed} {port}") for port in (0, 1)]
        )
        heard: list[bytes] = []
        for number in range(100):
            wired.receive(b"TFSFC %d" % number if number % 2 else b"HELLO", 0.0, 0)
            for _ in range(25):
                heard += [data for _, data in wired.advance()]
        return [data for _, _, data in wired.board.server.received], heard

    received, heard = talk(1)
    numbers = [int(data.split()[1]) for data in received if b" " in data]
    assert numbers != sorted(numbers)
    assert len(set(numbers)) < 50
    assert len(set(numbers)) < len(numbers)
    assert len(heard) != len(received)
    assert talk(1) == (received, heard)
    assert talk(2) != (received, heard)


def test_options_choose_the_robot_and_its_faults() -> None:
    """A sim:// URL accepts the options of the command line, and passes them to the controller."""
    board, lines = options.from_url(
        "sim://?firmware=documented&volts=21.5&imu-dies=3&stuck=left&speed-per-unit=0.01"
        "&metres-per-count=0.001&motor-inequality=0.05&front=2&rear=1&dock=4&encoder-inverted"
        "&motor-status=0x10&seed=7&lose=0.1&duplicate=0.1&delay=0.2&track=0.5&dead-zone=3",
        mart,
    )
    assert isinstance(board, mart.SimulatedMart)
    settings = board.server.settings
    assert settings.quirks == mart.DOCUMENTED
    assert (settings.volts, settings.imu_dies_s, settings.stuck) == (21.5, 3.0, "left")
    assert (settings.speed_mps_per_unit, settings.metres_per_count) == (0.01, 0.001)
    assert (settings.front_m, settings.rear_m, settings.dock_m) == (2.0, 1.0, 4.0)
    assert (settings.encoder_sign, settings.motor_status, settings.seed) == (-1, 16, 7)
    assert (settings.track_m, settings.dead_zone_units, settings.motor_inequality) == (0.5, 3, 0.05)
    assert len(lines) == 2
    default, _ = options.from_url("sim://", mart)
    assert default.server.settings == mart.MartSettings()  # type: ignore[attr-defined]


@pytest.mark.parametrize("word", ["volts=x", "volts=99", "motor-status=256", "stuck=front"])
def test_options_that_make_no_sense_are_refused(word: str) -> None:
    """A user gives a wrong option. The simulator refuses it with a message."""
    with pytest.raises(options.OptionError):
        options.from_url(f"sim://?{word}", mart)


def test_it_answers_on_two_udp_ports() -> None:
    """The driver's UDP transport exchanges datagrams with both ports of the controller."""
    with ServedBoard(mart.SimulatedMart()) as served:
        first, second = (int(address.rpartition(":")[2]) for address in served.addresses)
        assert second == first + 1
        ports = UdpPorts(served.addresses[0], 2)
        try:
            ports.write([(0, b"TF 0")])
            assert served.wait_for(lambda board: board.server.moving, 5.0)
            ports.write([(1, b"SL")])
            packet = (0, b"")
            while packet == (0, b""):
                packet = ports.read()
            assert packet[0] == 0
            assert packet[1].startswith(b"ok ")
            ports.write([(0, b"")])
            assert served.wait_for(lambda board: bool(board.server.crashed), 5.0)
            assert served.facts["crashed"] == "an empty datagram"
        finally:
            ports.close()


def test_it_answers_in_process() -> None:
    """A sim:// URL runs the controller in the driver's process, and it answers."""
    transport = SimulatedTransport("sim://?volts=25", "omnibot_driver.simulator.mart")
    try:
        transport.write([(0, b"VOLTS")])
        packet = (0, b"")
        while packet == (0, b""):
            packet = transport.read()
        assert packet == (0, b"ok 25.00")
    finally:
        transport.close()


def test_its_facts_are_known() -> None:
    """The values that the console shows of the simulated controller agree with its state."""
    board = mart.SimulatedMart(mart.MartSettings(imu_dies_s=0.0))
    board.receive(b"R", 0.0)
    for _ in range(1000):
        board.advance()
    facts = board.facts
    assert facts["moving"]
    assert facts["blocked"]
    assert not facts["hung"]
    assert not facts["imu"]
    assert facts["motion"] == "spin"
    assert facts["registers"] == [158, 98]
    board.reboot()
    assert not board.facts["moving"]
    assert board.facts["motion"] is None
