"""One picture of a scene, on a renderer of its own, and on a context that is kept for the next one."""

from __future__ import annotations

from collections.abc import Mapping

from PIL import Image

from raymarch.errors import warn_of_doubts
from raymarch.expr.calls import checked
from raymarch.gpu.context import kept_context
from raymarch.gpu.progress import told
from raymarch.gpu.renderer import Renderer
from raymarch.scene.parameter import ParamValue
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene, as_scene
from raymarch.scene.studio import staged
from raymarch.sdf.node import Node


@checked
def render(
    scene: Scene | Node,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    backend: str = "auto",
    strict: bool = False,
    alpha: bool = False,
    samples: int | None = None,
    quality: Quality | None = None,
) -> Image.Image:
    """Render a picture of a scene, or of a solid, as 8-bit sRGB; with `alpha`, as RGBA with a transparent sky.

    A solid alone is shown in a studio: on a ground, under a soft sun and a lit sky, in clay if no part of it has a
    material, with 4 rays per pixel. A solid without end is cut by a cube, with a SceneWarning, if a camera sees it from
    inside only. `studio` makes that scene. `Renderer.render`, `truth` and `raymarch cost` show a solid without it.

    For many frames use one `Renderer`, which compiles once. Each of `Frame.doubts` is emitted as a RenderWarning, also
    too many rays that run out of steps.

    Parameters
    ----------
    scene : a Scene, or a solid.
    size : (width, height) in pixels.
    time : value of `rm.time` in seconds.
    params : values of parameters by name.
    backend : see `Renderer`.
    strict : doubts raise RenderError.
    alpha : make the sky transparent.
    samples : rays per pixel, 1 or more, against aliasing and noise; 16 smooth the edges. None is that of the quality.
    quality : replaces the scene's; see `Quality.preset`.

    Returns
    -------
    PIL.Image.Image
        Of mode RGB, or RGBA with `alpha`.

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    DeviceError : no OpenGL, or a size that the driver cannot draw.
    RenderError : the picture may be wrong, with `strict`.

    Examples
    --------
    >>> rm.render(rm.sphere(1), size=(64, 36)).size
    (64, 36)
    """
    scene = staged(as_scene("render", scene))
    if quality is not None:
        scene = scene.replace(quality=quality)
    if samples is not None:
        scene = scene.replace(quality=scene.quality.replace(samples=samples))
    with kept_context(backend) as context, Renderer(size, context=context, strict=strict) as renderer:
        with told() as progress:
            frame = renderer.render(scene, time, params, progress=progress)
        if not strict:
            warn_of_doubts(doubt for doubt in frame.doubts(steps=True) if doubt not in frame.warnings)
        image = frame.image(alpha)
        del frame  # so that closing reads no arrays
        return image
