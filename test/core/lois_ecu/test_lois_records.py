# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of records as CSV files with units. A record that is abandoned leaves no file."""

from pathlib import Path

import pytest

from omnibot_driver.boards.lois_ecu_records import file_name, remark, save
from omnibot_driver.core.lois_ecu import Record, RecordKind
from omnibot_driver.core.lois_ecu.readings import RecordReading

RPM = Record(RecordKind.RPM, (500, 1000, 0xFFFF), (250, 10))


def read(path: Path, record: Record, count_s: float | None = 1e-4) -> str:
    assert save(RecordReading(record, count_s, 60), path)
    return path.read_text(encoding="utf-8")


def test_an_rpm_record_has_times_and_speeds(tmp_path: Path) -> None:
    """The CSV file of an RPM record has times between ticks, and speeds.

    The board reports 65535 for a time that does not fit into 16 bits. The cells of this time and of
    its speed are then empty.
    """
    assert read(tmp_path / "new" / "rpm.csv", RPM).splitlines() == [
        "sample,left_tick_s,right_tick_s,left_rpm,right_rpm,left_counts,right_counts",
        "0,0.0500000,0.0250000,20.00,40.00,500,250",
        "1,0.1000000,0.0010000,10.00,1000.00,1000,10",
        "2,,,,,65535,",
    ]
    assert remark(RecordReading(RPM, 1e-4, 60)).startswith("1 tick of the record")
    slow = Record(RecordKind.RPM, (0xFFFF, 500), (0xFFFF,))
    assert remark(RecordReading(slow, 1e-4, 60)).startswith("2 ticks of the record")


def test_without_a_known_unit_there_are_counts_alone(tmp_path: Path) -> None:
    """If the unit of the times in a record is unknown, the cells of times and speeds are empty.

    A remark for the log explains why.
    """
    assert read(tmp_path / "rpm.csv", RPM, None).splitlines()[1] == "0,,,,,500,250"
    assert "unit" in remark(RecordReading(RPM, None, 60))


def test_torque_and_headings_have_their_columns(tmp_path: Path) -> None:
    """The CSV file of a torque record has counts of the ADC, whose scale is unknown.

    The CSV file of a heading record has degrees.
    """
    torque = Record(RecordKind.TORQUE, (200, 300), (400, 500))
    assert read(tmp_path / "t.csv", torque).splitlines() == [
        "sample,left_adc_counts,right_adc_counts",
        "0,200,400",
        "1,300,500",
    ]
    heading = Record(RecordKind.HEADING, (-90, 12), ())
    assert read(tmp_path / "h.csv", heading) == "sample,heading_deg\n0,-90\n1,12\n"
    assert remark(RecordReading(heading, None, 60)) == ""


def test_a_record_that_nobody_waits_for_leaves_no_file(tmp_path: Path) -> None:
    """A record is abandoned, or its file cannot be written. No file is left."""
    assert not save(RecordReading(RPM, 1e-4, 60), tmp_path / "rpm.csv", lambda: False)
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError, match="taken"):
        save(RecordReading(RPM, 1e-4, 60), tmp_path / "taken")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_names_tell_what_and_when() -> None:
    """The file name of a record contains its kind and the UTC time, to the microsecond."""
    assert file_name(RecordKind.TORQUE, 0.25) == "torque_19700101T000000_250000.csv"
