"""Columns of a window that kernels read and append to."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from simnav.estimators.models.columns import Columns, Made
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.records import Record


class Table(Record):
    time: Vector
    value: Matrix
    node: IntegerVector


def filled(rows: int, made: Made | None = None) -> Columns:
    columns = Columns(made, time=(), value=(2,), node=np.int64)
    for k in range(rows):
        columns.append(time=float(k), value=(k, -k), node=k)
    return columns


def test_a_kernel_appends_rows_where_they_are_free():
    columns = filled(3)
    table = columns.record(Table)
    assert columns.free == len(table.time) - 3
    table.time[columns.last], table.value[columns.last] = 7.0, (8.0, 9.0)
    assert len(columns["time"]) == 3
    columns.grow(1)
    assert columns["time"].tolist() == [0.0, 1.0, 2.0, 7.0]
    assert columns["value"][-1].tolist() == [8.0, 9.0]


@pytest.mark.parametrize(("dropped", "count"), [(0, 5), (60, 40), (60, 64), (3, 200)])
def test_reserved_rows_are_free_and_the_others_stay(dropped: int, count: int):
    columns = filled(62)
    columns.drop(dropped)
    kept = columns["value"].copy()
    columns.reserve(count)
    assert columns.free >= count
    np.testing.assert_array_equal(columns["value"], kept)
    table = columns.record(Table)
    assert len(table.time) == len(table.value) >= len(kept) + count
    np.testing.assert_array_equal(table.value[columns.first : columns.last], kept)


def test_rows_are_not_moved_without_need():
    columns = filled(62)
    columns.drop(60)
    columns.reserve(2)
    assert columns.first == 60


def test_what_was_made_of_whole_columns_goes_when_an_array_is_replaced():
    made = Made()
    columns = filled(10, made)
    made["key"] = columns.record(Table)
    columns.drop(3)
    columns.reserve(55)  # the rows move to the front of the same arrays
    assert made["key"].time is columns.record(Table).time
    columns.reserve(1000)
    assert not made
    assert len(columns.record(Table).time) >= 1007


def test_a_record_is_made_once_until_an_array_is_replaced():
    made = Made()
    columns = filled(10, made)
    table = made.once(Table, lambda: columns.record(Table))
    assert made.once(Table, lambda: columns.record(Table)) is table
    columns.reserve(1000)
    assert made.once(Table, lambda: columns.record(Table)).time is columns.record(Table).time is not table.time


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda columns: pickle.loads(pickle.dumps(columns))])
def test_a_copy_has_rows_of_its_own(copied):
    columns = filled(5)
    columns["time"]  # a view that must not be shared
    other = copied(columns)
    other.append(time=9.0, value=(0.0, 0.0), node=9)
    other["value"][0] = 4.0
    assert other["time"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 9.0]
    assert columns["time"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert columns["value"][0].tolist() == [0.0, 0.0]


def test_copies_of_two_tables_share_what_is_made_of_them_and_begin_without():
    made = Made()
    first, second = filled(3, made), filled(4, made)
    made["key"] = first.record(Table)
    one, other = copy.deepcopy((first, second))
    assert made["key"].time is first.record(Table).time
    assert one._made is other._made
    assert one._made is not made
    assert not one._made
