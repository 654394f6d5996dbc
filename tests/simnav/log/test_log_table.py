"""CSV files: what is read, and every complaint."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.log.delimited import read_csv
from simnav.log.growing import GrowingTable
from simnav.log.table import LogError, utc_seconds


def write(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
@pytest.mark.parametrize("header", ["time{0}x{0}y\n", ""])
def test_delimiters_and_headers(tmp_path, delimiter, header):
    text = header.format(delimiter) + f"0.5{delimiter}1e3{delimiter}-2\n1.5{delimiter}3{delimiter}4\n\n"
    table = read_csv(write(tmp_path / "a.csv", text))
    assert table.names == (("time", "x", "y") if header else ("1", "2", "3"))
    sign, x = table.column("x" if header else 2)
    assert sign == 1.0
    np.testing.assert_array_equal(x, [1000.0, 3.0])
    assert table.column(-3)[0] == -1.0
    np.testing.assert_array_equal(table.line, [2, 3] if header else [1, 2])


def test_a_minus_flips_the_sign_unless_it_is_part_of_the_name(tmp_path):
    table = read_csv(write(tmp_path / "a.csv", "t,-x,y\n0,1,2\n"))
    assert table.column("-x") == (1.0, np.array([1.0]))
    assert table.column("-y") == (-1.0, np.array([2.0]))
    np.testing.assert_array_equal(table.column("=2.5")[1], [2.5])


def test_columns_lined_up_with_blanks(tmp_path):
    table = read_csv(write(tmp_path / "a.txt", "  time    x\n  0.5   1.0\n 10.5  -2.0  \n"))
    assert table.names == ("time", "x")
    np.testing.assert_array_equal(table.column("x")[1], [1.0, -2.0])


def test_a_byte_order_mark_and_quotes(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes('\ufeff"time","x"\r\n"1","2"\r\n'.encode())
    assert read_csv(path).names == ("time", "x")
    np.testing.assert_array_equal(read_csv(path).column("x")[1], [2.0])


def test_missing_cells_are_not_numbers(tmp_path):
    table = read_csv(write(tmp_path / "a.csv", "t,x\n0,\n1,nan\n2,5\n"))
    np.testing.assert_array_equal(table.column("x")[1], [np.nan, np.nan, 5.0])


def test_a_file_is_parsed_once_until_it_changes(tmp_path):
    path = write(tmp_path / "a.csv", "t,x\n0,1\n")
    first = read_csv(path)
    assert read_csv(path) is first
    write(path, "t,x\n0,1\n1,22\n")
    assert len(read_csv(path)) == 2


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("t,x\n0,1\n1,abc\n", "x", r"a\.csv, line 3, column 'x': 'abc' is not a number"),
        ("t,speed\n0,1\n", "sped", r"a\.csv: there is no column 'sped'; did you mean 'speed'"),
        ("t,speed\n0,1\n", 3, r"a\.csv: there is no column 3; the file has columns 1 to 2"),
        ("t,speed\n0,1\n", "=two", r"the constant column '=two' should be '=' and a number"),
        ("t,x\n0,1\n1\n2,3\n", "x", r"a\.csv, line 3: 1 cells where the first line has 2"),
        ("", "x", r"a\.csv: the file is empty"),
        ("t,x\n", "x", r"a\.csv: there are no rows"),
        ("t,x,x\n0,1,2\n", "x", r"a\.csv, line 1: two columns share a name"),
    ],
)
def test_complaints(tmp_path, text, column, message):
    with pytest.raises(LogError, match=message):
        read_csv(write(tmp_path / "a.csv", text)).column(column)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(LogError, match=r"nowhere\.csv: there is no such file"):
        read_csv(tmp_path / "nowhere.csv")


@pytest.mark.parametrize("delimiter", [",", " "])
def test_comments_anywhere_and_a_row_of_units(tmp_path, delimiter):
    lines = ["# made by hand", "t,x", "s,m", "0.5,1", "# a remark, with commas", "1.5,x", "", "2.5,3"]
    path = write(tmp_path / "a.csv", "\n".join(line if "#" in line else line.replace(",", delimiter) for line in lines))
    table = read_csv(path, "#", skip_rows=1)
    np.testing.assert_array_equal(table.column("t")[1], [0.5, 1.5, np.nan, 2.5])
    assert table.line.tolist()[:2] == [4, 6]
    with pytest.raises(LogError, match=r"a\.csv, line 6, column 'x': 'x' is not a number"):
        table.column("x")
    with pytest.raises(LogError, match="lines that are no data are left out by 'comment'"):
        read_csv(path)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_headers_with_letters_of_other_alphabets(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes("Zeit,Kurs [°]\r\n0,1\r\n1,20°\r\n".encode(encoding))
    table = read_csv(path)
    assert table.names == ("Zeit", "Kurs [°]")
    with pytest.raises(LogError, match=r"a\.csv, line 3, column 'Kurs \[°\]': '20°' is not a number"):
        table.column("Kurs [°]")


def test_a_column_changes_its_form_after_the_first_megabyte(tmp_path):
    rows = "".join(f"{k},1,,7\n" for k in range(120_000))
    path = write(tmp_path / "a.csv", f"t,x,late,word\n{rows}120000,2.5,3.5,seven\n")
    table = read_csv(path)
    assert table.column("x")[1][-2:].tolist() == [1.0, 2.5]
    assert table.column("late")[1][-1] == 3.5
    assert np.isnan(table.column("late")[1][0])
    with pytest.raises(LogError, match=r"line 120002, column 'word': 'seven' is not a number"):
        table.column("word")


def test_rows_one_by_one():
    growing = GrowingTable()
    growing.add({"a": 1.0, "name": "x"}, 3)
    growing.add({"b": 2.0}, 5)
    growing.add({"a": "y", "name": 1.0, "b": 4.0}, 6)
    table = growing.table("somewhere")
    np.testing.assert_array_equal(table.column("a")[1], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(table.column("b")[1], [np.nan, 2.0, 4.0])
    assert table.columns["name"].tolist() == ["x", None, None]
    assert table.line.tolist() == [3, 5, 6]


def test_stamps_with_the_day_of_the_year():
    assert utc_seconds("19+085:10:06:03.188") == utc_seconds("2019-03-26T10:06:03.188Z")
    with pytest.raises(ValueError, match="does not match"):
        utc_seconds("19+485:10:06:03.188")


def test_whole_numbers_above_those_of_a_double_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,x\n1714557600020000000,1\n1714557600040000000,2\n")
    assert read_csv(path).column("time")[1] == pytest.approx([1.71455760002e18, 1.71455760004e18], rel=1e-15)


@pytest.mark.parametrize(
    "text", ["t;x;note\n0,50;-1,25;a,b\n0,75;2;c\n", "0,50;-1,25\n0,75;2\n", "t\tx\n0,5\t-1,25\n0,75\t2\n"]
)
def test_decimal_commas(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    found = read_csv(path)
    assert found.column(1)[1].tolist() == [0.5, 0.75]
    assert found.column(2)[1].tolist() == [-1.25, 2.0]


def test_commas_and_points_are_no_decimal_commas(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t;x\n0.5;1,25\n0.75;2,5\n")
    found = read_csv(path)
    assert found.column("t")[1].tolist() == [0.5, 0.75]
    with pytest.raises(LogError, match="line 2, column 'x': '1,25' is not a number"):
        found.column("x")


def test_lines_that_end_in_a_carriage_return(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"t,x\r0.5,1\r0.75,2\r")
    assert read_csv(path).column("x")[1].tolist() == [1.0, 2.0]
