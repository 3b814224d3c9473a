"""The words of a test, in few digits, agree with the test on the number that they show."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.trees.text import Digits

PLACE = Schema((Feature("place", "m", -10.0, 10.0),), ("go",))


def tree_of(*thresholds):
    tree = DecisionTree.single_leaf(1)
    for threshold in thresholds:
        tree = tree.split(int(tree.leaf_of([threshold])), 0, threshold)
    return tree


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=6, unique=True))
def test_the_number_shown_is_decided_as_it_says(thresholds):
    digits = Digits(PLACE, tree_of(*thresholds))
    for threshold in thresholds:
        for words, passes in ((digits.at_most(0, threshold), True),
                              (digits.above(0, threshold), False)):  # fmt: skip
            sign, text = words.split()
            said = {"<=": True, "<": False, ">": False, ">=": True}[sign]
            assert said == ((float(text) <= threshold) == passes)


def test_a_test_just_below_a_number_says_less_than_it():
    digits = Digits(PLACE, tree_of(math.nextafter(5.0, 0.0)))
    assert digits.at_most(0, math.nextafter(5.0, 0.0)) == "< 5"
    assert digits.above(0, math.nextafter(5.0, 0.0)) == ">= 5"


def test_thresholds_of_two_trees_are_told_apart():
    digits = Digits(PLACE, tree_of(2.0), tree_of(2.0004))
    assert (digits.text(0, 2.0), digits.text(0, 2.0004)) == ("2", "2.0004")
    assert not digits.are_one(0, 2.0, 2.0004)
    assert digits.are_one(0, 2.0, float(np.nextafter(2.0, 3.0)))
