"""What the tab of the scan shows when a run has ended under it."""

from types import SimpleNamespace

from studio.desk import Desk
from studio.review.review_window import ReviewWindow


def test_a_scan_registered_under_its_tab_is_laid_over_the_photograph(tmp_path):
    window = ReviewWindow(
        SimpleNamespace(client_id=1), None, None, tmp_path, None, Desk(area="Session", tabs={"Session": "Scan"})
    )
    window.review = SimpleNamespace(missing={"scan": "not yet"})
    window.read = lambda: setattr(window, "review", SimpleNamespace(missing={}))
    window.choose = lambda **changes: None
    window.read_again()
    assert window.shown.overlay == "scan, shaded"
