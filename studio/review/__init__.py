"""A session's output folder looked at in the browser: frames, balls, lights, scan, twin, warnings; and put right.

What is read, measured, corrected, written and drawn are plain functions, without a browser: `folder`, `warning_places`,
`mirror`, `corrections`, `corrected_session`, `scan_picks`, `relight`, `hemisphere`, `photograph_picture`,
`contact_sheet`. The panels only call these.
"""
