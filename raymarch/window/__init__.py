"""The live window: a scene file is shown, watched, moved about in and inspected. The only room that shows windows."""
