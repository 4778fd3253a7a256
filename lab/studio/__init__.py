"""The bench in the browser: `rgbn studio`. A thin layer over the functions of the command line, shown by viser.

`edits`, `light_edits`, `placement` and `history` are the state, one immutable scene after the other, without a browser.
`live_scene` and `preview` draw it. The panels only call these.
"""
