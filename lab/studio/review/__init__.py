"""A session's output folder looked at in the browser: frames, balls, lights, scan, twin, warnings; and put right.

What is read, measured, corrected, written and drawn are plain functions, without a browser: `folder`, `warned`,
`mirror`, `corrections`, `amended`, `scan_picks`, `relight`, `hemisphere`, `photograph`, `contact_sheet`. The panels
only call these.
"""
