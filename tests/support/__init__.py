"""What tests of several folders share: samples of nodes and scenes, closed forms, and functions of GLSL on the GPU."""
