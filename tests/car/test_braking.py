"""What a machine may take of the braking."""

import numpy as np
import pytest

from hevopt import DataError, load_architecture
from hevopt.car.braking import Braking

EVEN = np.array([0.0, 10.0]), np.array([1.0, 1.0])


def test_the_share_follows_the_curve_and_holds_beyond_its_ends():
    braking = Braking(np.array([2.0, 6.0, 20.0]), np.array([0.0, 0.5, 0.8]), "front", 0.6, 0.2)
    found = braking.share(np.array([1.0, 2.0, 4.0, 13.0, 30.0]), np.full(5, 0.05))
    assert found == pytest.approx([0, 0, 0.25, 0.65, 0.8])


def test_a_front_axle_uses_no_more_adhesion_than_the_regulation_grants():
    rate = np.array([0.05, 0.3, 0.6])
    share = Braking(*EVEN, "front", 0.6, 0.2).share(np.full(3, 5.0), rate)
    used = share * rate / (0.6 + 0.2 * rate)
    assert share[0] == 1 and used[1:] == pytest.approx((rate[1:] + 0.07) / 0.85)


def test_a_rear_axle_never_locks_before_the_front_one():
    rate = np.array([0.05, 0.3, 0.6, 3.0])
    share = Braking(*EVEN, "rear", 0.4, 0.2).share(np.full(4, 5.0), rate)
    assert share[:3] == pytest.approx(0.4 - 0.2 * rate[:3]) and share[3] == 0


def test_without_braking_there_is_no_limit():
    assert Braking(*EVEN, "front", 0.6, 0.2).share(np.array([5.0]), np.array([0.0])) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"machine_share": [0.5, 0.8]}, "speed_kmh and machine_share must have one length"),
        ({"speed_kmh": [0, 20, 10]}, "speed_kmh must increase"),
        ({"axle": "both"}, "axle"),
        ({"machine_share": [0, 0.5, 1.2]}, "allowed: 0 to 1"),
    ],
)
def test_a_curve_that_is_none_is_a_message(changes, words):
    with pytest.raises(DataError, match=words):
        load_architecture("C2", {f"car.braking.{key}": value for key, value in changes.items()})
