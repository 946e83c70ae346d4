"""Materials at a hit: that of the part which decides the field, or a mean of several parts under a smooth blend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, TypeAlias

from raymarch.expr.choices import merge_calls, merge_reads
from raymarch.expr.derivative import opened, raw_gradient, saving, share_values
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, construct, make, swizzle, var
from raymarch.expr.operations import operations_of
from raymarch.expr.types import FLOAT, VEC3, struct
from raymarch.expr.vocabulary import abs, get, normalize, parts_of, record, where
from raymarch.expr.walk import find, free_variables, rebuild, rewrite, substitute
from raymarch.plan.bounding import BoundedUnion
from raymarch.plan.hoisting import Hoisting
from raymarch.plan.mixing import Palette, RowMaterial, blended, chosen_by, largest, read_where, same_constants, whole
from raymarch.plan.objects import Many, ObjectsInCells, only_slot, with_rows
from raymarch.plan.shading import has_relief, mapped, needs_surface, patterned
from raymarch.scene.bsdf import BSDF, Phong
from raymarch.scene.fields import FIELDS, GLASS, PHYSICAL, RELIEF
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene
from raymarch.scene.surfaces import bsdf_of
from raymarch.sdf.interaction import LOCAL_INTERACTION, SCENE_INTERACTION, interaction_at, material_expressions
from raymarch.sdf.lower import BoundedParts, Group, Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.rows import Slot
from raymarch.sdf.weights import weights_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Materials:
    """The generated functions that evaluate materials. Each is None if it is not needed.

    model : how materials are shaded: "phong", "physical", or "mixed" if there are both. bsdf : that of all materials.
    material : returns the struct Material, or Part with the gradient of the field. emission : emitted radiance.
    glass : returns the struct Glass. relief : returns the struct Relief.
    material_index : index of the material with the largest weight.
    """

    model: str = "phong"
    bsdf: BSDF = field(default_factory=Phong)
    material: Function | None = None
    emission: Function | None = None
    glass: Function | None = None
    relief: Function | None = None
    material_index: Function | None = None


def materials_of(
    scene: Scene,
    solid: Node,
    lowering: Lowering,
    shaded: bool,
    index: bool,
    field: Function | None,
    hoist: Hoisting,
    bent: bool = False,
) -> Materials:
    """The functions that evaluate materials at a hit. Smooth blends mix materials with the weights of normals.

    solid : the node of the scene with its objects as rows.
    shaded, index, bent : True if the functions that shade, the index of the material, normals with relief are needed.
    field : where given, the function of the material also returns the gradient of this field.
    """
    parts = _Parts(scene, solid, lowering, hoist)
    chosen = parts.materials
    kinds = {m.physical for m in chosen}
    model = "mixed" if len(kinds) == 2 else "physical" if True in kinds else "phong"
    bsdf, reflects = bsdf_of(chosen, scene.quality), shaded and needs_surface(scene)
    extra = SCENE_INTERACTION if mapped(scene) and reflects else ()
    glass = shaded and (scene.path_traced or scene.whitted) and any(m.transmits for m in chosen)
    made: dict[str, Function] = {}
    if reflects:
        outside = PHYSICAL if glass and model != "phong" else ()  # of the surface of glass
        wanted = _fields("Material", tuple(dict.fromkeys((*bsdf.fields, *outside))))
        if field is not None:
            made["material"] = parts.with_gradient("part_at", wanted, field, patterned(scene))
        else:
            made["material"] = parts.function("material_at", wanted, extra)
    if (reflects or bent) and has_relief(scene):
        made["relief"] = parts.function("relief_at", _fields("Relief", RELIEF), SCENE_INTERACTION)
    if glass:
        made["glass"] = parts.function("glass_at", _fields("Glass", GLASS), extra)
    if shaded and any(m.emits for m in chosen):
        made["emission"] = parts.function("emission_at", lambda values: values["emission"], extra)
    if index:
        made["material_index"] = parts.function("material_index", None)
    return Materials(model=model, bsdf=bsdf, **made)


Wanted: TypeAlias = Callable[[dict[str, Expr]], Expr]
"""What a function returns of a part's material values."""

OfGroup: TypeAlias = Callable[[Group, Expr], Expr]
"""What is wanted of a group at a point."""

Union: TypeAlias = Many | BoundedParts
"""The label of a union that is evaluated by a function of its own."""

OfMany: TypeAlias = Callable[[Union, Expr, Expr, Sequence[Expr]], Expr]
"""What is wanted of such a union at a point; their materials are evaluated at the second point. The last argument is
normal and footprint in the space of the point."""


def _fields(name: str, names: Sequence[str]) -> Wanted:
    def wanted(values: dict[str, Expr]) -> Expr:
        chosen = [values[n] for n in names]
        type = struct(name, tuple(zip(names, [value.type for value in chosen], strict=True)))
        return record(type, *chosen)

    return wanted


_gradient = lru_cache(8)(raw_gradient)
"""The gradients of the last fields: a scene is often planned again with other settings."""


@dataclass(slots=True)
class _Parts:
    """The parts of a scene with a material, and the functions that evaluate these.

    A subtree that stands at several places is a part of its own, whose value comes from a function.
    """

    scene: Scene
    solid: Node
    lowering: Lowering
    hoist: Hoisting
    marked: Function = field(init=False)

    def __post_init__(self) -> None:
        self.marked = self.hoist(self.lowering.again().field(self.solid, label=self.scene.materials[0], groups=True))

    @property
    def materials(self) -> list[Material]:
        """The materials of all parts."""
        found: dict[Material, None] = {}
        pending, seen = [self.marked], {self.marked}
        while pending:
            for mark in find([pending.pop().body], "mark"):
                if isinstance(mark.data, Many):
                    found.update((mark.data.inherited if m is None else m, None) for m in mark.data.rows.labels)
                elif isinstance(mark.data, BoundedParts):
                    pending += [each for each in mark.data.marked if each not in seen]
                    seen.update(mark.data.marked)
                elif not isinstance(mark.data, Group):
                    found[mark.data] = None
                elif mark.data.marked not in seen:
                    seen.add(mark.data.marked)
                    pending.append(mark.data.marked)
        return list(found) or [self.scene.materials[0]]

    def function(self, name: str, wanted: Wanted | None, extra: tuple[Expr, ...] = ()) -> Function:
        """A function of the point that returns what is wanted; with None the index of the material."""
        made: dict[Group, Function] = {}

        def of_group(group: Group, at: Expr) -> Expr:
            if group not in made:
                (body,) = shared([self._body(group.marked, wanted, of_group, of_many)])
                made[group] = Function(f"{group.name}_{name.removesuffix('_at')}", group.marked.params, body)
            return made[group](at)

        many: dict[Union, tuple[_Evaluated, Function]] = {}

        def of_many(label: Union, point: Expr, at: Expr, interaction: Sequence[Expr]) -> Expr:
            if label not in many:
                found = self._evaluated(label, wanted, of_group, of_many)
                many[label] = found, found.value_at(name.removesuffix("_at"))
            (found, value), local = many[label], dict(zip(LOCAL_INTERACTION, interaction, strict=True))
            return found.called(value, point, at, *(local.get(v, v) for v in value.params[2:]))

        def shared(roots: Sequence[Expr]) -> list[Expr]:
            roots = with_rows(roots, {found.distance: found.row for found, _ in many.values() if found.row})
            roots = merge_calls(roots, lambda f: operations_of(f) if f in made.values() else 0)
            return share_values(merge_reads(roots))

        (body,) = shared([self._body(self.marked, wanted, of_group, of_many)])
        return Function(name, (*self.marked.params, *extra), body)

    def with_gradient(self, name: str, wanted: Wanted, field: Function, inner: bool) -> Function:
        """A function of the point that returns the struct Part: the gradient of the field and what is wanted.

        inner : if True, materials are evaluated at a given depth below the point, along the gradient.
        """
        depth = var("depth", FLOAT) if inner else None
        return _WithGradient(self, wanted).part(name, field, self.marked, depth)

    def _body(
        self,
        marked: Function,
        wanted: Wanted | None,
        of_group: OfGroup,
        of_many: OfMany,
        inner: Expr | None = None,
        interaction: Sequence[Expr] = SCENE_INTERACTION,
    ) -> Expr:
        """What is wanted of the parts of a field, as a choice.

        inner : the point where materials are evaluated. interaction : normal and footprint in the space of the field.
        """
        marks, weights = weights_of(marked)
        terms = []
        unread: dict[Expr, Expr] = {}  # values that are read everywhere, by those read where the part has a weight
        for mark, weight in zip(marks, weights, strict=True):
            if isinstance(mark.data, Group):
                value = of_group(mark.data, mark.args[1])
            elif isinstance(mark.data, Union):
                at = mark.args[1]
                local = interaction if at is marked.params[0] else interaction_at(at, interaction)
                at, *local = [at, *local] if inner is None else substitute([at, *local], {marked.params[0]: inner})
                value = of_many(mark.data, mark.args[1], at, local)
            else:
                values = material_expressions(mark, interaction)
                both = [self._wanted(mark.data, each, wanted) for each in (read_where(values, weight), values)]
                value, whole = both if inner is None else substitute(both, {marked.params[0]: inner})
                unread[value] = whole
            terms.append((weight, value))
        default = self._wanted(self.scene.materials[0], self.scene.materials[0].expressions, wanted)
        if all(value is terms[0][1] for _, value in terms):
            return terms[0][1] if terms else default
        return chosen_by(terms, largest if wanted is None else partial(blended, unread), default)

    def _evaluated(self, label: Union, wanted: Wanted | None, of_group: OfGroup, of_many: OfMany) -> _Evaluated:
        if isinstance(label, Many):
            return _ManyMaterials(self, label, wanted)
        return _BoundedMaterials(self, label, wanted, of_group, of_many)

    def _wanted(self, material: Any, values: Sequence[Expr], wanted: Wanted | None) -> Expr:
        if wanted is None and isinstance(material, RowMaterial):
            return material.number
        if wanted is None:
            return const(float(self.scene.materials.index(material)))
        return wanted(dict(zip(FIELDS, values, strict=True)))


class _WithGradient:
    """Functions that return the gradient of a field and what is wanted of its parts.

    A group is evaluated once, by its part: in the gradient of what holds the group, that of the group is read from it.

    made : the function that takes the place of that of a field. fields : the field of each function that stands in for
    it. slopes : the field of each function that stands in for its gradient. many : the materials
    of unions at another point. joint : the parts of unions.
    """

    def __init__(self, parts: _Parts, wanted: Wanted) -> None:
        self.parts, self.wanted = parts, wanted
        self.made: dict[Function, Function] = {}
        self.fields: dict[Function, Function] = {}
        self.slopes: dict[Function, Function] = {}
        self.many: dict[Union, Function] = {}
        self.joint: dict[Union, Function] = {}

    def part(self, name: str, field: Function, marked: Function, depth: Expr | None = None) -> Function:
        """The function of a field. depth : below the point, where materials are evaluated, along the gradient."""
        (p,) = field.params
        inner = None if depth is None else var("inner", VEC3)
        material = self.parts._body(marked, self.wanted, self._of_group, self._of_many, inner)
        material = opened(material, p)
        replaced = rewrite([field.body], self._with_stand_in)[field.body]
        slope = _gradient(replaced, p)
        slope = rewrite([slope], self._with_part)[slope]
        found = rewrite([slope, material], self._with_distance)
        roots = [found[slope], found[material]]
        roots = merge_calls(roots, lambda f: operations_of(f) if f in self.made.values() else saving(f))
        slope, material = share_values(merge_reads(roots))
        if depth is not None:
            below = p - depth * normalize(slope)
            (material,) = substitute([material], {var("inner", VEC3): below})
        type = struct("Part", (("gradient", VEC3), ("material", material.type)))
        params = (p,) if depth is None else (p, depth)
        return Function(name, params, record(type, slope, material), field.names, field.where)

    def _stand_in(self, group: Function) -> Function:
        """A function in place of a group's field, whose gradient is not derived: the group's part has it."""
        found = next((each for each, field in self.fields.items() if field is group), None)
        if found is None:
            found = Function(group.name, group.params, group.body)
            slope = Function(group.name, group.params, construct(group.params[0], 0.0))
            found.stated.gradients[0] = slope
            self.fields[found], self.slopes[slope] = group, group
        return found

    def _of_group(self, group: Group, at: Expr) -> Expr:
        if group.field not in self.made:
            self.made[group.field] = self.part(f"{group.name}_part", group.field, group.marked)
        return get(self.made[group.field](at), "material")

    def _of_many(self, label: Union, point: Expr, at: Expr, _: Sequence[Expr]) -> Expr:
        found = self.parts._evaluated(label, self.wanted, self._of_group, self._of_many)
        if point is at and label not in self.joint and found.distance not in self.made:
            self.joint[label] = self.made[found.distance] = found.part()
        if point is at and label in self.joint:
            return get(self.joint[label](point), "material")
        if label not in self.many:
            self.many[label] = found.value_at("material")
        return self.many[label](point, at)

    def _with_stand_in(self, node: Expr, args: tuple[Expr, ...]) -> Expr:
        known = node.op == "call" and node.data in self.made
        return self._stand_in(node.data)(*args) if known else rebuild(node, args)

    def _with_part(self, node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "swizzle" and args[0].op == "call" and args[0].data in self.slopes:
            return swizzle(get(self.made[self.slopes[args[0].data]](*args[0].args), "gradient"), node.data)
        if node.op == "call" and node.data in self.fields:
            return self.fields[node.data](*args)
        return rebuild(node, args)

    def _with_distance(self, node: Expr, args: tuple[Expr, ...]) -> Expr:
        known = node.op == "call" and self.made.get(node.data) in self.joint.values()
        return get(self.made[node.data](*args), "distance") if known else rebuild(node, args)


class _Evaluated:
    """What is wanted of a union that is evaluated by a function of its own.

    name : prefix of its functions. point : the point of its distance. distance : that function. row : see
        `with_rows`; None for none.
    """

    name: str
    point: Expr
    distance: Function
    row: Function | None = None

    def evaluated(self, p: Expr, at: Expr) -> tuple[Expr, Expr, Expr]:
        """The distance and the gradient at p, and what is wanted, with materials evaluated at another point."""
        raise NotImplementedError

    def value_at(self, name: str) -> Function:
        """A function of a point and of the point where materials are evaluated."""
        at = var("at", VEC3)
        value = self.evaluated(self.point, at)[2]
        return Function(f"{self.name}_{name}", (self.point, at, *_interaction_in(value)), value)

    def called(self, value: Function, *given: Expr) -> Expr:
        """A call of a function of `value_at`; written out where its union also tells the row, to find that once."""
        known = dict(zip(value.params, given, strict=True))
        return value(*given) if self.row is None else substitute([value.body], known)[0]

    def part(self) -> Function:
        """A function of the point that returns what Part holds, and the distance."""
        distance, slope, material = self.evaluated(self.point, self.point)
        type = struct("UnionPart", (("distance", FLOAT), ("gradient", VEC3), ("material", material.type)))
        return Function(f"{self.name}_part", (self.point,), record(type, distance, slope, material))


class _BoundedMaterials(_Evaluated):
    """The materials of a hard union with boxes: the nearest operand is found first."""

    name = "nearest"

    def __init__(
        self, parts: _Parts, label: BoundedParts, wanted: Wanted | None, of_group: OfGroup, of_many: OfMany
    ) -> None:
        self.union, self.marked = label.union, label.marked
        self.distance = self.union.field
        (self.point,) = self.distance.params
        self.parts, self.wanted, self.below = parts, wanted, (of_group, of_many)

    def evaluated(self, p: Expr, at: Expr) -> tuple[Expr, Expr, Expr]:
        assert isinstance(self.union, BoundedUnion)
        distance, slope, nearest = self.union.walk(p, lambda i, pair: (pair[1], const(float(i))))
        values = [self._value(marked, at) for marked in self.marked]
        found = values[-1]
        for i, value in reversed(list(enumerate(values[:-1]))):
            found = where(nearest < i + 0.5, value, found)
        (found,) = merge_reads([found])
        return distance, slope, found

    def _value(self, marked: Function, at: Expr) -> Expr:
        return self.parts._body(self.parts.hoist(marked), self.wanted, *self.below, at, LOCAL_INTERACTION)


class _ManyMaterials(_Evaluated):
    """The materials of many objects.

    located : the objects and their cells. single : what is wanted, if it is the same for all; else None.
    """

    name = "objects"

    def __init__(self, parts: _Parts, label: Many, wanted: Wanted | None) -> None:
        objects = parts.lowering.objects
        assert isinstance(objects, ObjectsInCells)
        self.parts, self.label, self.wanted = parts, label, wanted
        self.rows = label.rows
        self.located = objects.located(self.rows)
        self.point, self.distance = self.located.point, self.located.field
        self.row = self.located.found
        self.single: Expr | None = None
        default = label.inherited
        labels = list(dict.fromkeys(default if m is None else m for m in self.rows.labels))
        self.slots = [only_slot(form.template) for form in self.rows.forms]
        materials = self.rows.materials_in(self.slots, default)
        index = {material: i for i, material in enumerate(parts.scene.materials)}
        if len(labels) == 1 and not labels[0].patterned and not labels[0].textured:
            self.single = parts._wanted(labels[0], labels[0].expressions, wanted)
            return
        numbers = [index.get(m, 0) for m in materials]
        palette = Palette([m.expressions for m in materials], numbers) if len(materials) > 1 else None
        self.common = palette if all(slot is not None for slot in self.slots) else None
        if self.common is not None and not label.rows.family:
            return
        self.functions = [self._function(i, palette, materials) for i in range(len(self.rows.forms))]

    def _function(self, i: int, palette: Palette | None, materials: Sequence[Material]) -> Function:
        """What is wanted of an object of a form: a function of the point, the place of materials, columns and slots."""
        form, varying = self.rows.forms[i], self.rows.stored.varying[i]
        slots = [var(f"material {j}", FLOAT) for j in varying]
        at = var("at", VEC3)
        marked = form.columns.function("marked", form.marked(Slot(0)))
        known = {}
        for mark in find([marked.body], "mark"):
            if isinstance(mark.data, Slot):
                j = mark.data.index
                material: Any
                if j in varying:
                    assert palette is not None
                    material = RowMaterial(palette, slots[varying.index(j)])
                else:
                    material = materials[form.slots[0, j]]
                known[mark] = make("mark", FLOAT, mark.args, material)
        (body,) = substitute([marked.body], known)

        def refuse(*_: Any) -> Expr:
            raise AssertionError("a group inside a row")

        inner = Function("marked", marked.params, body)
        value = self.parts._body(inner, self.wanted, refuse, refuse, at, LOCAL_INTERACTION)
        given = (inner.params[0], at, *inner.params[1:], *slots, *_interaction_in(value))
        return Function("object_material", given, value)

    def evaluated(self, p: Expr, at: Expr) -> tuple[Expr, Expr, Expr]:
        """The distance and the gradient at p, and what is wanted, with materials evaluated at another point.

        Of a hard union, the row of the nearest object is found first. If the material is a row of a palette, it is
        enough to remember which.
        """
        located, place = self.located, self.located.place
        if self.single is not None:
            distance, slope = located.walk(place, p, lambda i, entry, read: ())
            return distance, slope, self.single
        if self.rows.family:
            return self._blended(p, at)
        if self.common is not None:

            def slots(i: int, _entry: Expr, read: Sequence[Expr]) -> Sequence[Expr]:
                varying = self.rows.stored.varying[i]
                fixed = const(float(self.rows.forms[i].slots[0, self.slots[i]]))
                return [read[-1] if varying else fixed]

            distance, slope, row = located.walk(place, p, slots)
            material = RowMaterial(self.common, row)
            return distance, slope, self.parts._wanted(material, material.expressions, self.wanted)
        distance, slope, entry = located.walk(place, p, lambda i, entry, read: (entry,))
        stored = self.rows.stored
        found = [f(p, at, *stored.read(i, entry), *_interaction_in(f.body)) for i, f in enumerate(self.functions)]
        return distance, slope, stored.choose(entry, found)

    def _blended(self, p: Expr, at: Expr) -> tuple[Expr, Expr, Expr]:
        """The same for a blend: the mean of what is wanted. What is the same constant for all objects is not summed."""
        bodies = [function.body for function in self.functions]
        same = same_constants(bodies) if self.wanted is not None else {}

        def carried(i: int, _entry: Expr, read: Sequence[Expr]) -> Sequence[Expr]:
            value = self.functions[i](p, at, *read, *_interaction_in(bodies[i]))
            if self.wanted is None:
                return [value, const(1.0)]
            return [part for k, part in enumerate(parts_of(value)) if k not in same]

        def larger(wa: Expr, wb: Expr, left: Sequence[Expr], right: Sequence[Expr]) -> Sequence[Expr]:
            slope = wa * left[0] + wb * right[0]
            a, b = wa * left[2], wb * right[2]
            same = abs(left[1] - right[1]) < 0.5
            return slope, where(a < b, right[1], left[1]), where(same, a + b, where(a < b, b, a))

        located = self.located
        mixed = larger if self.wanted is None else None
        distance, slope, *values = located.walk(located.place, p, carried, mixed)
        if self.wanted is None:
            return distance, slope, values[0]
        return distance, slope, whole(self.functions[0].type, values, same)


def _interaction_in(value: Expr) -> list[Expr]:
    """The parts of the surface interaction on which the value of a function depends."""
    free = free_variables([value])
    return [variable for variable in (*SCENE_INTERACTION, *LOCAL_INTERACTION) if variable in free]
