"""A scene built and lit in the browser. The panels only call the functions of the other modules.

`edits` and `placement` are the state, one immutable scene after the other, without a browser. `preview` draws it.
"""
