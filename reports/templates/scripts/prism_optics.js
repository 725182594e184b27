"use strict";
// Light in the section of a prismatic panel: refraction, Fresnel reflection by polarisation, total internal reflection and
// re-entry, ray by ray. Lengths in pitches; outdoors is z < 0; y is up. In this plane s and p light never mix.

const NEAR = 1e-7; // Of a pitch: a ray does not meet the line that it starts from.
const FAINT = 1e-6; // Of a ray's light: what is followed no further.
const MOST_CELLS = 4000;

// The section: base and absorption are in pitches; angles between sheet and facet in degrees, as of transom.products.
function prismSection({ pitch, base, angle_low, angle_high, index, absorption }) {
  const [low, high] = [angle_low, angle_high].map((angle) => 1 / Math.tan((angle * Math.PI) / 180));
  const height = 1 / (low + high);
  const bottom = base / pitch;
  const corners = [[0, bottom], [height * low, bottom + height], [1, bottom]];
  const facets = [[corners[0], corners[1]], [corners[1], corners[2]]].map(([a, b]) => {
    const [dy, dz] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(dy, dz);
    return { a, dy, dz, normal: [-dz / length, dy / length] };
  });
  return { bottom, top: bottom + height, corners, facets, index, absorption: absorption * pitch };
}

// Where a ray meets the section next: {t, normal}, the normal out of the panel; null for one that leaves.
function nextLine(section, ray) {
  const flat = ray.dz === 0 ? -1 : -ray.z / ray.dz;
  const facet = nextFacet(section, ray);
  if (flat > NEAR && (!facet || flat < facet.t)) return { t: flat, normal: [0, -1] };
  return facet;
}

function nextFacet(section, { y, z, dy, dz }) {
  const reach = (level) => (level - z) / dz;
  const inBand = z > section.bottom - NEAR && z < section.top + NEAR;
  if (dz === 0 && !inBand) return null;
  let [begin, end] = dz === 0 ? [0, Infinity] : [reach(section.bottom), reach(section.top)].sort((a, b) => a - b);
  begin = Math.max(begin, 0);
  if (end < NEAR) return null;
  let cell = Math.floor(y + dy * begin);
  for (let count = 0; count < MOST_CELLS; count += 1, cell += Math.sign(dy)) {
    const leave = dy === 0 ? Infinity : (cell + (dy > 0 ? 1 : 0) - y) / dy;
    let best = null;
    for (const facet of section.facets) {
      const across = dy * facet.dz - dz * facet.dy;
      const [ay, az] = [facet.a[0] + cell - y, facet.a[1] - z];
      const t = (ay * facet.dz - az * facet.dy) / across;
      const along = (ay * dz - az * dy) / across;
      if (t > NEAR && along > -1e-9 && along < 1 + 1e-9 && (!best || t < best.t)) best = { t, normal: facet.normal };
    }
    if (best) return best;
    if (leave > end || dy === 0) return null;
  }
  return null;
}

// Shares of s and p light that a boundary reflects [Fresnel], and the refracted direction; all of it beyond the critical angle.
function meetBoundary(ray, normal, index) {
  const outwards = ray.dy * normal[0] + ray.dz * normal[1];
  const leaves = outwards > 0;
  const [n1, n2] = leaves ? [index, 1] : [1, index];
  const cosine = Math.abs(outwards);
  const side = leaves ? 1 : -1;
  const reflected = [ray.dy - 2 * outwards * normal[0], ray.dz - 2 * outwards * normal[1]];
  const sine2 = (n1 / n2) ** 2 * (1 - cosine * cosine);
  if (sine2 >= 1) return { leaves, reflected, refracted: null, s: 1, p: 1 };
  const inner = Math.sqrt(1 - sine2);
  const refracted = [0, 1].map((axis) => (n1 / n2) * [ray.dy, ray.dz][axis] + (inner - (n1 / n2) * cosine) * side * normal[axis]);
  const share = (a, b) => ((a - b) / (a + b)) ** 2;
  return { leaves, reflected, refracted, s: share(n1 * cosine, n2 * inner), p: share(n2 * cosine, n1 * inner) };
}

// Parallel light from `profileDeg` above the horizontal. exits: [{angle, share}], degrees up from the horizontal, brightest
// first; shares of the incident light. paths: [{from, to, share}] of the rays that start in `drawn` places.
function tracePrism(section, profileDeg, rayCount = 400, drawn = 0) {
  const profile = (profileDeg * Math.PI) / 180;
  const found = { transmitted: [], reflected: 0, absorbed: 0, unfinished: 0, paths: [] };
  const send = (count, keepPaths) => {
    for (let number = 0; number < count; number += 1) {
      const place = (number + 0.37) / count;
      const start = { y: place + 2 * Math.tan(profile), z: -2, dy: -Math.sin(profile), dz: Math.cos(profile) };
      followRay(section, { ...start, s: 0.5 / count, p: 0.5 / count }, FAINT / count, keepPaths ? found.paths : null, found);
    }
  };
  if (drawn > 0) {
    send(drawn, true);
    const paths = found.paths.map((path) => ({ ...path, share: path.share * drawn }));
    return { ...tracePrism(section, profileDeg, rayCount), paths };
  }
  send(rayCount, false);
  return { ...found, exits: mergedExits(found.transmitted) };
}

function followRay(section, first, faint, paths, found) {
  const waiting = [first];
  while (waiting.length > 0) {
    const ray = waiting.pop();
    const hit = nextLine(section, ray);
    if (paths) paths.push({ from: [ray.y, ray.z], to: hit ? [ray.y + hit.t * ray.dy, ray.z + hit.t * ray.dz] : null, ...ray, share: ray.s + ray.p });
    if (!hit) {
      if (ray.dz > 0) found.transmitted.push({ angle: (Math.atan2(ray.dy, ray.dz) * 180) / Math.PI, share: ray.s + ray.p });
      else found.reflected += ray.s + ray.p;
      continue;
    }
    const met = meetBoundary(ray, hit.normal, section.index);
    const kept = met.leaves ? Math.exp(-section.absorption * hit.t) : 1;
    found.absorbed += (1 - kept) * (ray.s + ray.p);
    const [y, z] = [ray.y + hit.t * ray.dy, ray.z + hit.t * ray.dz];
    const parts = [[met.reflected, met.s, met.p]];
    if (met.refracted) parts.push([met.refracted, 1 - met.s, 1 - met.p]);
    for (const [[dy, dz], s, p] of parts) {
      const next = { y, z, dy, dz, s: kept * ray.s * s, p: kept * ray.p * p };
      if (next.s + next.p > faint) waiting.push(next);
      else found.unfinished += next.s + next.p;
    }
  }
}

// Exits that leave in one direction, to 0.02 degrees, as one.
function mergedExits(exits) {
  const merged = [];
  for (const exit of [...exits].sort((a, b) => a.angle - b.angle)) {
    const last = merged[merged.length - 1];
    if (last && exit.angle - last.angle < 0.02) last.share += exit.share;
    else merged.push({ ...exit });
  }
  return merged.sort((a, b) => b.share - a.share);
}
