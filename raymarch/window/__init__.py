"""The interactive window: shows, reloads and inspects a scene file. The only package that opens visible windows."""
