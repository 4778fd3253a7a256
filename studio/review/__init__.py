"""A session's output folder looked at in the browser: frames, balls, lights, scan, twin, warnings; and put right.

What is read, measured, corrected, written and drawn are plain functions, without a browser. A class `*Panel` is one
tab, a class `*View` what stands in the 3-D view; both only call these.
"""
