"""A scene built and lit in the browser: `edits` are functions from one document to the next, without a browser."""
