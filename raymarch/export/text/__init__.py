"""A scene as text for other programs: one module for each form, named by the suffix of its files.

A module defines `text_of(scene, values)`, which returns a `raymarch.export.inputs.Text`.
"""
