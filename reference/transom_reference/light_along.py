"""What light does along a straight line: opaque surfaces, panes, sky beyond, and the densities of opening sampling."""

from __future__ import annotations

from typing import Any

import numpy as np

from transom_reference.mitsuba_setup import dr, floats, mi
from transom_reference.panels import PanelSide, panel_side, residual
from transom_reference.surface import gather4, offset
from transom_reference.transport_scene import SKY_ROWS, TABLE_INTERVALS, TransportScene

UNROLLED_PORTALS = 64
"""Up to so many portals their weights are written out in the kernel; beyond, a loop reads them from the table."""

MAX_PANES = 32
"""Panes that one straight line may cross."""


class LightAlong:
    """Visibility, glass, sky and opening densities of one TransportScene."""

    def __init__(self, scene: TransportScene) -> None:
        self.scene = scene
        if scene.sun_direction is not None:
            self.sun_direction = mi.Vector3f(*map(float, scene.sun_direction))
            dr.make_opaque(self.sun_direction)
        self.sun_probability = floats(scene.sun_starts_probability) if scene.portals else None
        if scene.portals:
            points = np.stack([portal.weight_points for portal in scene.portals])
            self.weight_points = floats(points)
            self.scales = np.array([p.area for p in scene.portals]) * np.maximum(scene.portal_weights, 1e-6) * 0.25
            # Portals that send nothing indoors are still possible: a tiny weight costs nothing and keeps W positive.
            self.softening = np.array([0.05 * p.area for p in scene.portals])
            rows = np.stack(
                [self.scales, self.softening, np.zeros_like(self.scales), np.zeros_like(self.scales)], axis=1
            )
            self.weight_rows = floats(rows)

    # -- sky and ground -------------------------------------------------------------------------------------------

    def beyond(self, direction: Any, active: Any) -> Any:
        """Radiance of the sky (bilinear in the table) or of the ground in a direction, RGB [cd/m²]."""
        columns = 4 * SKY_ROWS
        row = dr.acos(dr.clip(direction.z, 0.0, 1.0)) * (SKY_ROWS / (0.5 * np.pi))
        column = dr.atan2(direction.y, direction.x) * (columns / (2 * np.pi))
        column = dr.select(column < 0.0, column + columns, column)
        row_0 = dr.minimum(mi.UInt32(row), SKY_ROWS - 1)
        column_0 = dr.minimum(mi.UInt32(column), columns - 1)
        column_1 = dr.select(column_0 + 1 < columns, column_0 + 1, 0)
        r, c = row - mi.Float(row_0), column - mi.Float(column_0)
        up = active & (direction.z > 0.0)
        a, b, d, e = (
            dr.gather(mi.Float, self.scene.sky_table, (row_0 + i) * columns + k, up)
            for i in (0, 1)
            for k in (column_0, column_1)
        )
        sky = dr.lerp(dr.lerp(a, b, c), dr.lerp(d, e, c), r)
        return dr.select(direction.z > 0.0, self.scene.sky_rgb * sky, self.scene.ground)

    # -- glass ----------------------------------------------------------------------------------------------------

    def transmittance(self, opening: Any, cosine: Any, active: Any) -> Any:
        """Directional transmittance of an opening, linear between the table's entries."""
        return self._of_angle(self.scene.glass_table, opening, cosine, active)

    def mirror(self, opening: Any, cosine: Any, active: Any) -> Any:
        """Directional reflectance of an opening's room side; for scenes that have a mirror_table."""
        return self._of_angle(self.scene.mirror_table, opening, cosine, active)

    def _of_angle(self, table: Any, opening: Any, cosine: Any, active: Any) -> Any:
        if not self.scene.portals:
            return mi.Float(1.0)
        position = dr.clip(cosine, 0.0, 1.0) * TABLE_INTERVALS
        entry = dr.minimum(mi.UInt32(position), TABLE_INTERVALS - 1)
        row = opening * (TABLE_INTERVALS + 1) + entry
        low = dr.gather(mi.Float, table, row, active)
        high = dr.gather(mi.Float, table, row + 1, active)
        return dr.lerp(low, high, position - mi.Float(entry))

    def _panes(
        self, origin: Any, direction: Any, length: Any, active: Any, viewer: tuple[Any, Any, Any] | None, sun: bool
    ) -> tuple[Any, Any, Any]:
        """Product of transmittances, product of the probabilities of passing, and a sum of densities over the panes.

        The sum is of opening-sampling densities (solid angle) from viewer = (point, normal, weight sum), or, for `sun`,
        of sun-patch densities (per area across the beam), or zero.
        """
        scene = self.scene
        passed, probability, density = mi.Float(1.0), mi.Float(1.0), mi.Float(0.0)
        if scene.glass is None:
            return passed, probability, density

        def body(
            active: Any, origin: Any, length: Any, count: Any, passed: Any, probability: Any, density: Any
        ) -> tuple[Any, ...]:
            ray = mi.Ray3f(origin, direction)
            ray.maxt = length
            found = scene.glass.ray_intersect_preliminary(ray, active=active)
            hit = active & found.is_valid()
            portal = dr.gather(mi.UInt32, scene.portal_of_glass_triangle, found.prim_index, hit)
            last_row = gather4(scene.portal_table, portal * 4 + 3, hit)
            along = dr.dot(last_row.xyz, direction)
            opening = mi.UInt32(last_row.w)
            share = self.transmittance(opening, dr.abs(along), hit)
            room = dr.select(along > 0.0, self._room_reflectance(opening, along, hit), 0.0)
            passing = dr.select(room > 0.0, share / (share + room), 1.0)
            point = origin + found.t * direction
            if viewer is not None:
                here, normal, weight_sum = viewer
                added = self.density_at(portal, point, along, here, normal, weight_sum, hit)
                density = density + dr.select(hit, added, 0.0)
            elif sun:
                area = gather4(scene.portal_table, portal * 4, hit).w
                chosen = dr.gather(mi.Float, self.sun_probability, portal, hit)
                density = density + dr.select(hit & (along > 0.0), chosen / (area * along), 0.0)
            passed = dr.select(hit, passed * share, passed)
            probability = dr.select(hit, probability * passing, probability)
            onward = offset(point, last_row.xyz * dr.sign(along))
            count = count + 1
            return (
                hit & (count < MAX_PANES) & (passed > 0.0),
                dr.select(hit, onward, origin),
                length - found.t,
                count,
                passed,
                probability,
                density,
            )

        state = (
            mi.Bool(active),
            mi.Point3f(origin),
            mi.Float(length),
            mi.UInt32(0),
            passed,
            probability,
            density,
        )
        state = dr.while_loop(state, lambda active, *_: active, body, label="panes")
        return state[4], state[5], state[6]

    def _room_reflectance(self, opening: Any, cosine: Any, active: Any) -> Any:
        if self.scene.mirror_table is not None:
            return self.mirror(opening, cosine, active)
        return dr.gather(mi.Float, self.scene.room_reflectance, opening, active)

    def _clear(self, origin: Any, direction: Any, length: Any, active: Any) -> Any:
        """Active lanes that meet no opaque surface within `length`."""
        if self.scene.opaque is None:
            return active
        ray = mi.Ray3f(origin, direction)
        ray.maxt = length
        return active & ~self.scene.opaque.ray_test(ray, active=active)

    def sun(self, origin: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """Transmittance towards the sun (0: hidden) and the density with which sun patches are made, per m² of beam."""
        active = self._clear(origin, direction, mi.Float(dr.inf), active)
        passed, _, density = self._panes(origin, direction, mi.Float(dr.inf), active, None, True)
        return dr.select(active, passed, 0.0), density

    def outward(
        self, origin: Any, direction: Any, here: Any, normal: Any, weight_sum: Any, active: Any
    ) -> tuple[Any, Any, Any]:
        """Transmittance to the sky (0: hidden), a ray's probability of passing, opening-sampling density [1/sr]."""
        active = self._clear(origin, direction, mi.Float(dr.inf), active)
        viewer = (here, normal, weight_sum)
        passed, probability, density = self._panes(origin, direction, mi.Float(dr.inf), active, viewer, False)
        return dr.select(active, passed, 0.0), probability, density

    def unhindered(self, origin: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """Transmittance to the sky (0: hidden) and a ray's probability of passing."""
        active = self._clear(origin, direction, mi.Float(dr.inf), active)
        passed, probability, _ = self._panes(origin, direction, mi.Float(dr.inf), active, None, False)
        return dr.select(active, passed, 0.0), probability

    def between(self, origin: Any, direction: Any, distance: Any, active: Any) -> tuple[Any, Any]:
        """Transmittance between two points (0: hidden) and the probability that a path's ray passes."""
        length = distance * (1.0 - 1e-5)
        active = self._clear(origin, direction, length, active)
        passed, probability, _ = self._panes(origin, direction, length, active, None, False)
        return dr.select(active, passed, 0.0), probability

    # -- products -------------------------------------------------------------------------------------------------

    def panel_at(self, triangle: Any, direction: Any, active: Any) -> PanelSide:
        """The panel's room side at a hit of the whole scene; lanes where there is none are not active in it."""
        portal = dr.gather(mi.UInt32, self.scene.portal_of_glass_triangle, triangle - self.scene.opaque_count, active)
        assert self.scene.panels is not None
        return panel_side(self.scene.panels, portal, direction, active)

    def panel_sun(self, side: PanelSide, point: Any, normal: Any) -> Any:
        """Radiance of the sun's residual at a point of a panel as far as the sun reaches it, RGB; normal: outwards."""
        panels = self.scene.panels
        assert panels is not None
        if self.scene.sun_direction is None or not panels.residual.any():
            return mi.Color3f(0.0)
        radiance = residual(panels, side)
        lit = side.active & (dr.max(radiance) > 0.0)
        passed, _ = self.sun(offset(point, normal), self.sun_direction, lit)
        return dr.select(lit, radiance * passed, 0.0)

    def beam(self, origin: Any, index: Any, active: Any) -> tuple[Any, Any]:
        """How much of a panel beam reaches a point, and the density with which lit points are made, per m² of beam.

        The first thing met against the beam must be the room side of a panel of its group; from there on it is the sun.
        """
        scene, panels = self.scene, self.scene.panels
        assert panels is not None
        row = gather4(panels.beam_table, index * 2, active)
        against = -mi.Vector3f(row.xyz)
        found = scene.all.ray_intersect_preliminary(mi.Ray3f(origin, against), active=active)
        hit = active & found.is_valid() & (found.prim_index >= scene.opaque_count)
        portal = dr.gather(mi.UInt32, scene.portal_of_glass_triangle, found.prim_index - scene.opaque_count, hit)
        normal = gather4(scene.portal_table, portal * 4 + 3, hit).xyz
        along = dr.dot(normal, against)
        hit &= (along > 0.0) & (dr.gather(mi.Float, panels.portal_group, portal, hit) == row.w)
        passed, _ = self.sun(offset(origin + found.t * against, normal), self.sun_direction, hit)
        area = gather4(scene.portal_table, portal * 4, hit).w
        chosen = dr.gather(mi.Float, self.sun_probability, (index + 1) * len(scene.portals) + portal, hit)
        return dr.select(hit, passed, 0.0), dr.select(hit, chosen / (area * along), 0.0)

    # -- choosing an opening --------------------------------------------------------------------------------------

    def portal_point(self, choice: Any, u: Any, v: Any, here: Any, normal: Any, active: Any) -> tuple[Any, Any, Any]:
        """A portal chosen by weight, a point on it, uniform in area, and the sum of weights at `here`."""
        portal, weight = self._choose(choice, here, normal, active)
        corner = gather4(self.scene.portal_table, portal * 4, active)
        edge_u = gather4(self.scene.portal_table, portal * 4 + 1, active)
        edge_v = gather4(self.scene.portal_table, portal * 4 + 2, active)
        fold = (edge_u.w > 0.5) & (u + v > 1.0)
        u, v = dr.select(fold, 1.0 - u, u), dr.select(fold, 1.0 - v, v)
        return portal, mi.Point3f(corner.xyz + u * edge_u.xyz + v * edge_v.xyz), weight

    def _choose(self, choice: Any, here: Any, normal: Any, active: Any) -> tuple[Any, Any]:
        count = len(self.scene.portals)
        if count <= UNROLLED_PORTALS:
            sums: list[Any] = []
            total = mi.Float(0.0)
            for portal in range(count):
                total = total + self._literal_weight(portal, here, normal)
                sums.append(total)
            level = choice * total
            chosen = mi.UInt32(0)
            for value in sums[:-1]:
                chosen = chosen + dr.select(value <= level, mi.UInt32(1), mi.UInt32(0))
            return chosen, total

        def add(index: Any, total: Any) -> tuple[Any, Any]:
            return index + 1, total + self._table_weight(index, here, normal, active)

        def seek(index: Any, total: Any) -> tuple[Any, Any]:
            return index + 1, total + self._table_weight(index + 1, here, normal, active)

        _, total = dr.while_loop((mi.UInt32(0), mi.Float(0.0)), lambda index, _: index < count, add, label="weights")
        level = choice * total
        start = (mi.UInt32(0), self._table_weight(mi.UInt32(0), here, normal, active))
        chosen, _ = dr.while_loop(
            start, lambda index, total: (index + 1 < count) & (total <= level), seek, label="choose opening"
        )
        return chosen, total

    def _literal_weight(self, portal: int, here: Any, normal: Any) -> Any:
        source = self.scene.portals[portal]
        outward = mi.Vector3f(*map(float, source.normal))
        points = [mi.Point3f(*map(float, point)) for point in source.weight_points]
        return _weight(points, outward, float(self.scales[portal]), float(self.softening[portal]), here, normal)

    def _table_weight(self, portal: Any, here: Any, normal: Any, active: Any) -> Any:
        outward = gather4(self.scene.portal_table, portal * 4 + 3, active).xyz
        row = gather4(self.weight_rows, portal, active)
        points = [dr.gather(mi.Point3f, self.weight_points, portal * 4 + k, active) for k in range(4)]
        return _weight(points, outward, row.x, row.y, here, normal)

    def density_at(
        self, portal: Any, point: Any, along: Any, here: Any, normal: Any, weight_sum: Any, active: Any
    ) -> Any:
        """Solid-angle density with which `here` samples this portal at `point` [1/sr]; along: cosine to its normal."""
        area = gather4(self.scene.portal_table, portal * 4, active).w
        chosen = self._table_weight(portal, here, normal, active) / weight_sum
        density = chosen * dr.squared_norm(point - here) / (area * dr.abs(along))
        return dr.select((weight_sum > 0.0) & (along > 0.0), density, 0.0)

    def portal_density(
        self, triangle: Any, point: Any, direction: Any, here: Any, normal: Any, weight_sum: Any, active: Any
    ) -> Any:
        """The same for a hit of the whole scene; triangle: row of its table, glass after opaque."""
        if not self.scene.portals:
            return mi.Float(0.0)
        portal = dr.gather(mi.UInt32, self.scene.portal_of_glass_triangle, triangle - self.scene.opaque_count, active)
        along = dr.dot(gather4(self.scene.portal_table, portal * 4 + 3, active).xyz, direction)
        return self.density_at(portal, point, along, here, normal, weight_sum, active)


def _weight(points: list[Any], outward: Any, scale: Any, softening: Any, here: Any, normal: Any) -> Any:
    """Estimate of a portal's illuminance at `here`: sum of cos cos / distance² over its four points, softened."""
    total = mi.Float(0.0)
    for point in points:
        gap = point - here
        flow = dr.maximum(dr.dot(normal, gap), 0.0) * dr.maximum(dr.dot(outward, gap), 0.0)
        total = total + flow / dr.square(dr.squared_norm(gap) + softening)
    return total * scale
