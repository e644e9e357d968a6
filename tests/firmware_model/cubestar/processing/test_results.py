"""What is known before any picture."""

from cubestack.firmware_model.cubestar.processing.results import Results


def test_before_a_picture_there_are_no_stars() -> None:
    results = Results()
    assert (results.points.shape, results.vectors.shape) == ((0, 2), (0, 3))
    assert results.best == []
    assert results.detection is results.identification is None
