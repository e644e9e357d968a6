"""What an experiment does unless it says otherwise."""

from cubestack.host.experiments.facts import Facts, Telling


class Told(Telling):
    """Facts are given, not measured."""

    def run(self, opened, options):
        yield Facts({"name": "sun", "angle_deg": 1.5, "found": None})


def test_a_row_is_the_result_s_values_in_their_order() -> None:
    told = Told()
    (result,) = told.run(None, None)
    assert told.row(0, result) == ("sun", "1.5", "None")
