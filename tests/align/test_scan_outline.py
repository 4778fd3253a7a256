"""Pictures read at fractions of a pixel."""

import numpy as np

from align.pose.scan_outline import sample


def test_nothing_is_read_at_no_pixels():
    """An outline without any edge left the registration with the image library's own message."""
    image = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert sample(image, np.zeros((0, 37, 2))).shape == (0, 37)
    np.testing.assert_allclose(sample(image, np.array([[0.5, 1.0], [3.0, 2.0]])), [4.5, 11.0])
