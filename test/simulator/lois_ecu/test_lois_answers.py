# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A table that names a test of the driver for each quirk of the LOIS ECU's firmware.

A quirk is a deviation from the manual.
"""

import ast
from dataclasses import fields
from pathlib import Path

from omnibot_driver.simulator.lois_ecu import Quirks

TEST = Path(__file__).parents[2]
ANSWERS: dict[str, str] = {
    "ticks_of_forward_targets": "test_standstill_is_proved_where_ticks_count",
    "odometry_stands_at_equal_speeds": "test_the_boards_own_odometry_would_be_wrong",
    "velocity_may_be_nan": "test_a_velocity_that_is_not_a_number_is_not_a_speed",
    "sign_of_command": "test_hard_steering_to_both_sides_is_followed",
    "keeps_speed_of_stalled_wheel": (
        "test_without_clearing_a_slower_start_fails_on_the_public_firmware"
    ),
    "duty_drags_target": "test_duty_backward_is_known_by_commands_alone",
    "reverse_runs_fast": "test_backward_its_way_is_within_3_percent_and_its_place_within_10",
    "low_pass_starts_at_zero": "test_opened_it_is_configured_and_drives",
    "extra_settings": "test_opened_it_is_configured_and_drives",
    "appends_odometry": "test_odometry_behind_ticks_is_told_by_its_length",
    "clock_in_ms": "test_the_unit_of_the_boards_clock_is_learnt",
    "clock_stops_while_sending": "test_a_read_that_is_late_is_told",
    "deaf_while_sending": "test_every_setting_arrives_however_many_there_are",
    "deaf_while_counting": "test_no_loss_of_up_to_two_characters_makes_another_line",
    "button_waits_while_sending": "test_a_long_record_is_heard_while_it_comes",
    "odometry_period_is_fixed": "test_opened_it_is_configured_and_drives",
    "terminal_mode_zeroes_correction": (
        "test_out_of_a_terminal_mode_the_correction_is_back_and_the_button_is_unknown"
    ),
    "button_is_lost_in_terminal_mode": (
        "test_out_of_a_terminal_mode_the_correction_is_back_and_the_button_is_unknown"
    ),
    "terminal_mixes_sensors": "test_a_terminal_mode_stops_first_and_refuses_motion",
    "reset_clears_ticks_only": "test_reset_is_confirmed_by_the_ticks",
    "terminal_passes_input_on": (
        "test_a_latched_estop_does_not_jam_a_board_that_passes_it_on_to_the_compass"
    ),
    "one_ball_in_six_seconds": "test_led_and_ball",
    "gps_is_ignored": "test_a_fix_of_the_public_firmware_is_none",
    "headings_average_over_north": "test_false_headings_at_north_are_refused",
    "records_in_100_us": "test_a_record_is_made_whole",
    "torque_comes_as_rpm": "test_a_record_of_torque_may_come_under_the_number_of_the_tick_times",
    "record_waits_for_one_more": "test_a_record_is_made_whole",
    "large_records_never_end": "test_a_record_that_cannot_complete_is_refused",
    "lenient_hex": "test_no_loss_of_up_to_two_characters_makes_another_line",
    "limits_rpm": "test_wheel_rates_are_whole_rpm_at_most_50",
    "fast_control": "test_a_step_is_predicted_as_the_simulated_board_makes_it",
    "slow_timer": "test_forward_it_is_within_2_percent_and_3_degrees_on_5_m",
    "slow_boot": "test_a_restarted_board_is_configured_again",
}


def test_every_quirk_has_an_answer() -> None:
    """The table ``ANSWERS`` has an entry for each quirk, and the tests that it names exist."""
    assert set(ANSWERS) == {field.name for field in fields(Quirks)}
    there = {
        node.name
        for file in TEST.glob("*/lois_ecu/test_*.py")
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }
    assert set(ANSWERS.values()) <= there
