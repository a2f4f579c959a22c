import pickle

import numpy as np

from hevopt.problem.late import Late


def test_it_is_worked_out_once_and_only_where_it_is_asked_for():
    asked = []

    def work():
        asked.append(1)
        return {"power_w": np.array([1.0, 2.0])}

    late = Late(work)
    assert not asked
    assert list(late) == ["power_w"]
    assert len(late) == 1
    assert late["power_w"][1] == 2.0
    assert "speed" not in late
    assert asked == [1]


def test_a_copy_is_a_plain_dictionary():
    copied = pickle.loads(pickle.dumps(Late(lambda: {"power_w": np.ones(2)})))
    assert type(copied) is dict
    assert repr(copied) == repr(Late(lambda: copied))
