"""Statistics against cases worked by hand, and their laws."""

import numpy as np
import pytest

from compare.statistics.statistics import (
    ALBEDO,
    albedo_statistics,
    angular_statistics,
    error_correlation,
)

NAN = np.nan


def test_every_statistic_of_a_case_worked_by_hand():
    found = angular_statistics(np.array([[0.0, 10.0, NAN], [5.0, 1.0, 4.0]]))
    # 0, 1, 4, 5, 10: mean 4, squares 16 + 9 + 0 + 1 + 36 = 62; 5 and 10 themselves are not under 5 and 10.
    assert found == pytest.approx(
        {
            "min_deg": 0,
            "max_deg": 10,
            "mean_deg": 4,
            "median_deg": 4,
            "std_deg": np.sqrt(62 / 5),
            "q1_deg": 1,
            "q3_deg": 5,
            "under_5_deg": 3 / 5,
            "under_10_deg": 4 / 5,
            "pixels": 5,
        },
        abs=1e-12,
    )


def test_no_pixel_is_no_statistic_rather_than_zero():
    found = angular_statistics(np.full((3, 3), NAN))
    assert found.pop("pixels") == 0
    assert np.isnan(list(found.values())).all()


def test_the_albedo_s_error_is_relative_and_up_to_a_scale_a_channel():
    truth = np.array([[0.5, 0.2], [0.4, 0.2], [0.2, 0.2], [0.0, NAN], [0.1, 0.1]])
    off = np.array([[1.0, 1.0], [1.1, 1.0], [0.8, 1.0], [7.0, 1.0], [NAN, 1.3]])
    # 0, 10, 20; 0, 0, 0, 30 percent: what is black or unknown counts for nothing.
    assert list(albedo_statistics(off * truth, truth, is_scaled=False)) == list(ALBEDO)
    expected = [0, 30, 60 / 7, 0, np.sqrt((100 + 400 + 900) / 7 - (60 / 7) ** 2)]
    for scale in ([1.0, 1.0], [3.0, 0.2]):
        found = albedo_statistics(scale * off * truth, truth)
        assert list(found.values()) == pytest.approx(expected, abs=1e-9)
    assert albedo_statistics(2 * truth, truth, is_scaled=False)["albedo_mean_percent"] == pytest.approx(100)
    assert np.isnan(list(albedo_statistics(NAN * truth, truth).values())).all()


def test_correlation_worked_by_hand_with_ties_and_unknown_pixels():
    real = np.array([1.0, 2.0, 2.0, 3.0, NAN, 50.0])
    twin = np.array([2.0, 1.0, 3.0, 6.0, 70.0, NAN])
    found = error_correlation(real, twin)
    # Values: cov = ((-1)(-1) + 0 + 0 + (1)(3)) / 4 = 1; var = 2 / 4, 14 / 4.
    # Ranks: 1, 2.5, 2.5, 4 and 2, 1, 3, 4: centred products 0.75 + 0 + 0 + 2.25 = 3; squares 4.5 and 5.
    assert found["pixels"] == 4
    assert found["pearson"] == pytest.approx(4 / np.sqrt(2 * 14))
    assert found["spearman"] == pytest.approx(3 / np.sqrt(4.5 * 5))
    assert found["median_difference_deg"] == 2 - 2.5


@pytest.mark.parametrize("twin", [np.full(9, 3.0), np.full(9, NAN)], ids=["constant", "unknown"])
def test_without_a_pattern_there_is_no_correlation(twin):
    found = error_correlation(np.arange(9.0), twin)
    assert np.isnan(found["pearson"])
    assert np.isnan(found["spearman"])
