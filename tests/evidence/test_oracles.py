"""The stored 50-digit values are what independent code computes from the physics."""

from oracles.values import agrees, recomputed


def test_values_of_every_kind_are_computed_anew_to_their_last_digit(values):
    found = list(recomputed(values, impacts_each=4))
    kinds = {what.split(" ")[0] for what, _, _ in found}
    assert {"w=2.0,n=1", "period", "grazing", "w=0.95", "chatter", "flow", "static", "release"} <= kinds
    assert [what for what, value, text in found if not agrees(value, text)] == []


def test_a_changed_digit_would_be_noticed(values):
    (what, value, text), *_ = recomputed(values, impacts_each=1)
    changed = text[:-2] + str((int(text[-2]) + 5) % 10) + text[-1]
    assert agrees(value, text)
    assert not agrees(value, changed), what
