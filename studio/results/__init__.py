"""A session's results looked at in the browser: two maps under one cursor, a pixel's samples with every solver's fit.

What is read, drawn and charted are plain functions, without a browser: `result_maps`, `viewport`, `side_by_side`,
`pixel`, `pixel_charts`. The panel only calls these.
"""
