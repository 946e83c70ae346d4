import raymarch as rm

box = (rm.box((1.6, 1.6, 1.6)).round(0.1) - rm.sphere(1.1)).rotate(0.6, "y").translate((-1.3, 0, 0))
ring = rm.union(rm.torus(0.8, 0.3), rm.sphere(0.6), k=0.3).rotate(1.1, "x").translate((1.3, 0.2, 0))
floor = rm.plane(offset=-0.9).material(rm.Material(color=(0.05, 0.15, 0.2)))

solid = box.material(rm.Material(color=(0.9, 0.22, 0.1))) | ring.material(rm.Material(color=(0.9, 0.6, 0.1))) | floor
scene = rm.Scene(solid, camera=rm.Camera(position=(1.5, 2.5, 6.5), target=(0, 0, 0)), lights=[rm.Sun(shadow=True)])
