"""Spheres of many materials among 64 point lights that all cast shadows.

After figure 6 of Hadji-Kyriacou and Arandjelovic, "Raymarching Distance Fields with CUDA" (2021).
"""

import colorsys
import math

import raymarch as rm

parts = []
for i in range(5):
    for j in range(5):
        tint = colorsys.hsv_to_rgb(0.08 + 0.11 * i, 0.35 + 0.1 * j, 0.9)
        skin = rm.Material(albedo=tint, metalness=float((i + j) % 2), roughness=0.15 + 0.15 * j)
        parts.append(rm.sphere(0.4).translate((1.1 * (i - 2), 0.4, 1.1 * (j - 2))).material(skin))
floor = rm.plane().material(rm.Material(albedo=rm.checker((0.5, 0.5, 0.5), (0.3, 0.3, 0.3), 0.55), roughness=0.6))

lights = []
for k in range(64):
    ring, turn = 1.0 + 0.5 * (k % 5), 2.399963 * k
    place = (ring * math.cos(turn), 1.1 + 0.5 * math.sin(1.7 * k), ring * math.sin(turn))
    tint = colorsys.hsv_to_rgb(k / 64, 0.6, 1.0)
    lights.append(rm.PointLight(place, color=tint, intensity=0.12, range=2.5, shadow=True))

scene = rm.Scene(
    rm.union(*parts) | floor,
    camera=rm.Camera(position=(2.2, 2.8, 5.2), target=(0, 0.2, 0), fov=45),
    lights=lights,
    sky=(0.01, 0.012, 0.02),
    tone=rm.ToneMapping("aces", exposure=1),
)
