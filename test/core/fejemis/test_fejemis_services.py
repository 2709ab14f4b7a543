# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of requests other than motion, such as calibrations and the configuration."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, ask, nominal

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.jobs import Jobs
from omnibot_driver.core.fejemis.messages import Comment, Status, WheelConfiguration
from omnibot_driver.core.fejemis.readings import (
    Job,
    JobDone,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated


def test_the_gyro_is_calibrated_by_the_board() -> None:
    """The board calibrates its gyro at the user's request.

    The request succeeds when the board reports a gyro offset that differs from the earlier one.
    """
    bench = nominal(Simulated(gyro_bias_dps=(1.0, -2.0, 3.0)))
    done = ask(bench, Job.CALIBRATE_GYRO)
    assert done.success
    assert bench.robot.drive.config.gyro_offset_dps == pytest.approx((1.0, -2.0, 3.0), abs=0.2)
    bench.events.clear()
    bench.run(0.5)
    assert bench.imu[-1].angular_velocity[2] == pytest.approx(0.0, abs=0.02)


def test_a_calibration_is_done_when_its_offsets_were_read_twice_alike() -> None:
    """The driver reports success only after it has read the same new offsets twice.

    A single reading may come from a damaged answer whose checksum fits by chance.
    """
    jobs = Jobs()
    jobs.ask(Job.CALIBRATE_GYRO, None, 0.0)
    jobs.due(0.0)
    for at, numbers in ((0.1, 1.0), (0.5, 1.0), (2.0, 9.0), (2.4, 1.0)):
        jobs.hear("drive", Status("gyroo", (numbers, 0.0, 0.0)), at)
        jobs.due(at)
        assert not jobs.done
    for at in (2.8, 3.2):
        jobs.hear("drive", Status("gyroo", (2.0, 0.0, 0.0)), at)
    assert jobs.done[0].success


def lose(bench: Bench, word: bytes, times: int) -> None:
    """Lose the first ``times`` packets that contain ``word`` on their way to the boards."""
    receive, left = bench.robot.receive, [times]

    def lossy(data: bytes, now: float, channel: int) -> None:
        if word in data and left[0]:
            left[0] -= 1
        else:
            receive(data, now, channel)

    bench.robot.receive = lossy  # type: ignore[method-assign]


@pytest.mark.slow
def test_a_calibration_whose_command_is_lost_is_commanded_once_more() -> None:
    """The command to calibrate is lost, so the offsets do not change. The driver sends it again."""
    bench = nominal(Simulated(gyro_bias_dps=(1.0, -2.0, 3.0)))
    lose(bench, b"gyroc", 1)
    assert ask(bench, Job.CALIBRATE_GYRO).success
    assert bench.robot.drive.config.gyro_offset_dps == pytest.approx((1.0, -2.0, 3.0), abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "word"),
    [(Job.CALIBRATE_GYRO, "gyroc"), (Job.CALIBRATE_ACCELEROMETER, "acccal2")],
)
def test_a_calibration_that_changes_nothing_fails(job: Job, word: str) -> None:
    """A calibration whose commands are lost fails, because the offsets stay unchanged.

    Sensor noise changes the offsets a little in every real calibration.
    """
    bench = nominal()
    lose(bench, word.encode(), 99)
    done = ask(bench, job)
    assert not done.success
    assert "unchanged" in done.message
    assert bench.lines(DRIVE).count(word) == 2


@pytest.mark.slow
@pytest.mark.parametrize("channel", [DRIVE, FRONT])
def test_a_board_that_does_not_hear_gets_no_loaded_configuration(channel: int) -> None:
    """One board receives nothing, but still sends its data.

    The user's request to load a configuration fails. The driver answers the request within 5 s.
    """
    bench = nominal()
    bench.run(1.5)
    bench.hears.discard(channel)
    done = ask(bench, Job.LOAD, 5.0)
    assert not done.success
    assert "not confirmed" in done.message


def test_a_front_board_that_does_not_know_the_request_has_heard_the_loading() -> None:
    """The front board does not know the driver's query ``fwoi``, and answers with an error.

    A request to load a configuration still succeeds: the error proves that the board receives
    lines.
    """
    jobs = Jobs()
    jobs.ask(Job.LOAD, None, 0.0)
    for at in (0.0, 0.5, 1.0, 1.5):
        said = jobs.due(at)
    assert said["front"] == [b"fwoi"]
    jobs.hear("drive", WheelConfiguration(0.08, 0.08, 15.0, 68.0, 0.4, 0.001), 1.6)
    assert not jobs.done
    jobs.hear("front", Comment("# 12.3 unhandled: 'fwoi'"), 1.7)
    assert jobs.done[0].success


@pytest.mark.slow
@pytest.mark.parametrize("job", [Job.SAVE, Job.LOAD, Job.POWER_OFF])
def test_boards_that_fall_silent_do_not_delay_an_answer(job: Job) -> None:
    """The user requests a job, and both boards fall silent. The job fails within 5 s."""
    bench = nominal()
    bench.run(1.5)
    bench.speaks.clear()
    assert not ask(bench, job, 5.0).success


def test_the_accelerometer_is_calibrated_by_the_board() -> None:
    """The board calibrates its accelerometer, and the published force is then gravity alone."""
    bench = nominal(Simulated(accel_bias_mps2=(0.2, -0.1, 0.3)))
    assert ask(bench, Job.CALIBRATE_ACCELEROMETER).success
    bench.events.clear()
    bench.run(0.5)
    assert bench.imu[-1].specific_force == pytest.approx((0.0, 0.0, 9.80665), abs=0.1)


@pytest.mark.slow
def test_the_accelerometer_is_not_calibrated_while_a_parameter_sets_its_offsets() -> None:
    """A parameter sets the accelerometer's offsets and would undo a calibration.

    The driver refuses the calibration.
    """
    offsets = (0.1, 0.2, 0.3, 1.0, 1.0, 1.0)
    bench = nominal(settings=FejemisSettings(written={Written.ACCELEROMETER: offsets}))
    bench.run(2.0)
    with pytest.raises(RequestRefused, match="accel_calibration"):
        bench.board.services.ask(Job.CALIBRATE_ACCELEROMETER, None, bench.now)
    assert ask(bench, Job.CALIBRATE_GYRO).success
    assert bench.board.advice is None


@pytest.mark.slow
def test_no_job_is_done_while_the_robot_is_driven() -> None:
    """While the robot is driven, only the loading of a configuration is accepted.

    The driver stops the robot before it loads.
    """
    bench = nominal()
    bench.drive_on()
    for job in (job for job in Job if job is not Job.LOAD):
        with pytest.raises(RequestRefused, match="commanded"):
            bench.board.services.ask(job, None, bench.now)
    assert ask(bench, Job.LOAD).success
    assert bench.robot.standing


@pytest.mark.slow
def test_a_job_that_nothing_confirms_fails() -> None:
    """The board receives nothing, so the job is not confirmed and fails within its time limit.

    Until then, other jobs are refused.
    """
    bench = nominal()
    bench.hears = {FRONT}
    token, asked_s = object(), bench.now
    bench.board.services.ask(Job.CALIBRATE_GYRO, token, bench.now)
    with pytest.raises(RequestRefused, match="under way"):
        bench.board.services.ask(Job.SAVE, None, bench.now)
    while not bench.extras(JobDone):
        bench.run(0.1)
        assert bench.now - asked_s < 9.0
    (done,) = bench.extras(JobDone)
    assert not done.success
    assert done.token is token


def test_a_job_is_answered_when_the_port_is_lost() -> None:
    """The port is lost during a job. The job fails at once."""
    bench = nominal()
    token = object()
    bench.board.services.ask(Job.CALIBRATE_GYRO, token, bench.now)
    bench.settle()
    bench.close()
    (done,) = bench.extras(JobDone)
    assert done.token is token
    assert "port was lost" in done.message


def test_a_robot_that_rolls_is_not_calibrated() -> None:
    """The robot was stopped but still rolls. The driver refuses to calibrate."""
    bench = nominal()
    bench.drive_on(0.5)
    bench.drive(0.0)
    with pytest.raises(RequestRefused, match="moves"):
        bench.board.services.ask(Job.CALIBRATE_GYRO, None, bench.now)


def test_a_configuration_is_saved_and_loaded() -> None:
    """The user saves the configuration, and then loads it. Both boards execute the requests."""
    bench = nominal(settings=FejemisSettings(written={Written.STEERING: (0.41, 0.43)}))
    assert bench.robot.drive.saved.confs_m == (0.4, 0.42)
    assert ask(bench, Job.SAVE).success
    assert bench.robot.drive.saved.confs_m == (0.41, 0.43)
    assert bench.robot.front.saved.confs_m == (0.41, 0.43)
    assert ask(bench, Job.LOAD).success


@pytest.mark.parametrize(
    ("job", "name"),
    [
        (Job.CALIBRATE_GYRO, "gyro calibration"),
        (Job.CALIBRATE_ACCELEROMETER, "accelerometer calibration"),
        (Job.SAVE, "saving of the configuration"),
        (Job.LOAD, "loading of the configuration"),
        (Job.POWER_OFF, "power-off"),
    ],
)
def test_a_refusal_during_a_job_names_the_job_without_an_article(job: Job, name: str) -> None:
    """During a job, another job is refused. The refusal begins with the name of the running job."""
    jobs = Jobs()
    jobs.ask(job, None, 0.0)
    with pytest.raises(RequestRefused) as refused:
        jobs.ask(Job.SAVE, None, 0.0)
    begins = f"{name} is under way; wait for its answer"
    assert str(refused.value) == f"{begins}, then call again"
    assert jobs.at_rest in ("", begins)


@pytest.mark.slow
@pytest.mark.parametrize("job", [Job.CALIBRATE_GYRO, Job.CALIBRATE_ACCELEROMETER, Job.LOAD])
def test_a_robot_is_not_driven_while_a_job_needs_it_at_rest(job: Job) -> None:
    """During a calibration, or while the boards load their configuration, motion is refused.

    The robot must be at rest during these jobs.
    """
    bench = nominal()
    bench.board.services.ask(job, None, bench.now)
    bench.settle()
    bench.run(0.2)
    with pytest.raises(CommandRefused, match="under way"):
        bench.drive()
    bench.run_until(lambda: bool(bench.extras(JobDone)))
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.parametrize("job", [Job.CALIBRATE_GYRO, Job.LOAD])
@pytest.mark.parametrize("stop", ["e-stop", "pause"])
def test_an_estop_or_a_pause_ends_what_needs_the_robot_at_rest(job: Job, stop: str) -> None:
    """An e-stop or a pause comes during a job. The job fails at once."""
    bench = nominal()
    bench.board.services.ask(job, None, bench.now)
    bench.settle()
    bench.run(0.2)
    if stop == "e-stop":
        bench.estop(True)
    else:
        bench.session.request(Request.PAUSE, object(), bench.now)
        bench.settle()
    bench.run(0.1)
    (done,) = bench.extras(JobDone)
    assert not done.success
    assert ("the e-stop was latched" if stop == "e-stop" else "was paused") in done.message


@pytest.mark.slow
def test_settings_are_written_again_after_a_loading_that_an_estop_ends() -> None:
    """An e-stop interrupts a request to load the saved configuration.

    The boards may already have loaded it, so the driver writes the user's settings again.
    """
    bench = nominal(settings=FejemisSettings(written={Written.FRONT_WHEEL: (2.5, 0.0)}))
    bench.run(2.0)
    bench.board.services.ask(Job.LOAD, None, bench.now)
    bench.settle()
    bench.run(0.2)
    assert bench.robot.front.config.angle_offset_deg == 0.0
    bench.estop(True)
    bench.estop(False)
    bench.run(2.5)
    assert bench.robot.front.config.angle_offset_deg == 2.5


@pytest.mark.slow
def test_settings_are_written_again_to_both_boards_if_one_restarts_during_a_loading() -> None:
    """If one board restarts while both load saved values, both get the settings again."""
    wheels = (0.08, 0.08, 9.7, 48.0, 0.4)
    bench = nominal(settings=FejemisSettings(written={Written.WHEELS: wheels}))
    bench.run(2.0)
    bench.board.services.ask(Job.LOAD, None, bench.now)
    bench.settle()
    bench.run(0.2)
    assert bench.robot.drive.config.radii_m != wheels[:2]
    bench.robot.front.reboot()
    bench.run(2.5)
    assert bench.robot.drive.config.radii_m == wheels[:2]


def test_loading_stops_the_robot_before_it_loads() -> None:
    """A request to load the configuration during a drive first stops the robot.

    ``eer``, the command to load, waits until the robot has had time to stop.
    """
    bench = nominal()
    bench.drive_on()
    mark = bench.now
    bench.board.services.ask(Job.LOAD, None, bench.now)
    bench.settle()
    bench.run(1.0)
    lines = bench.lines(DRIVE, mark)
    assert lines.index("rc 2 0 0") < lines.index("eer")
    begun = [at for at, _, data in bench.written if at >= mark and data.startswith(b";20eer")]
    assert begun[0] - mark > 0.4


def test_a_shutdown_ends_the_job_and_writes_nothing_more_to_the_boards() -> None:
    """The driver shuts down while a job loads a configuration.

    The job fails, and names the shutdown as the cause. The driver sends only stop commands and
    front-wheel angles, and no settings.
    """
    bench = nominal()
    bench.drive_on(seconds=0.3)
    bench.board.settings = FejemisSettings(written={Written.FRONT_WHEEL: (3.0, 0.0)})
    bench.board.services.ask(Job.LOAD, None, bench.now)
    bench.settle()
    bench.run(0.2)
    mark = bench.now
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    bench.run(0.6)
    assert {text.split()[0] for text in bench.lines(DRIVE, mark)} == {"rc", "fwl"}
    assert set(bench.lines(FRONT, mark)) == {"rc 2 0 0", "motv 0 0", "brush 0"}
    (done,) = bench.extras(JobDone)
    assert not done.success
    assert "shutting down" in done.message
