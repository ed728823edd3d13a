// Loads of twists and their margins in the cone, as stablepush.surfaces and stablepush.stability compute them.
// Wrenches are normalised, (fx, fy, tau/rho), twists too, (vx, vy, rho*omega).
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross3 = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((v) => v * s);
const unitOf = (a) => scaled(a, 1 / Math.hypot(...a));
function solve3(m, b) {
  const c = [cross3(m[1], m[2]), cross3(m[2], m[0]), cross3(m[0], m[1])], d = dot(m[0], c[0]);
  return [0, 1, 2].map((k) => (c[0][k] * b[0] + c[1][k] * b[1] + c[2][k] * b[2]) / d);
}
// the load of a twist: friction of points, or the load on H = 1 whose gradient is along the twist
function loadOf(surface, twist) {
  const v = unitOf(twist);
  if (surface.kind === "support") {
    const f = [0, 0, 0];
    surface.points.forEach(([x, y], k) => {
      const px = x / surface.rho, py = y / surface.rho, ux = v[0] - v[2] * py, uy = v[1] + v[2] * px, size = Math.hypot(ux, uy);
      if (size < 1e-12) return;
      const fx = surface.loads[k] * ux / size, fy = surface.loads[k] * uy / size;
      f[0] += fx; f[1] += fy; f[2] += px * fy - py * fx;
    });
    return f;
  }
  const { exponents, coefficients, degree } = surface, power = (x, n) => n < 0 ? 0 : x ** n;
  const value = (f) => exponents.reduce((s, [i, j, k], n) => s + coefficients[n] * power(f[0], i) * power(f[1], j) * power(f[2], k), 0);
  const gradient = (f) => [0, 1, 2].map((a) => exponents.reduce((s, e, n) => {
    const d = e.slice(); d[a] -= 1;
    return e[a] ? s + coefficients[n] * e[a] * power(f[0], d[0]) * power(f[1], d[1]) * power(f[2], d[2]) : s;
  }, 0));
  const hessian = (f) => [0, 1, 2].map((a) => [0, 1, 2].map((b) => exponents.reduce((s, e, n) => {
    const d = e.slice(); d[a] -= 1; const first = e[a], second = d[b]; d[b] -= 1;
    return first && second > 0 ? s + coefficients[n] * first * second * power(f[0], d[0]) * power(f[1], d[1]) * power(f[2], d[2]) : s;
  }, 0)));
  // the least of the convex H(f) - v.f; along f it is known in closed form
  const settle = (f) => { const h = value(f), p = dot(v, f); return scaled(f, (p / (degree * h)) ** (1 / (degree - 1))); };
  let f = settle(v);
  for (let step = 0; step < 60; step++) {
    const g = gradient(f).map((x, k) => x - v[k]);
    if (Math.hypot(...g) < 1e-13) break;
    const move = solve3(hessian(f), g), start = value(f) - dot(v, f);
    let share = 1, next = f;
    do { next = f.map((x, k) => x - share * move[k]); share /= 2; } while (value(next) - dot(v, next) > start && share > 1e-6);
    f = next;
  }
  return scaled(f, value(f) ** (-1 / degree));
}
// edges of the cone: of each finger, the force that slides left and the one that slides right along its face
function coneOf(contact, rho) {
  const edges = [], normals = contact.normals.map((n) => unitOf([...n, 0]));
  contact.points.forEach(([x, y], finger) => {
    const [nx, ny] = normals[finger];
    for (const side of [1, -1]) {
      const fx = nx - side * contact.mu * ny, fy = ny + side * contact.mu * nx;
      edges.push({ finger, side, ray: unitOf([fx, fy, (x * fy - y * fx) / rho]) });
    }
  });
  const facets = [];
  edges.forEach((a, i) => edges.forEach((b, j) => {
    if (j <= i) return;
    const n = cross3(a.ray, b.ray), size = Math.hypot(...n);
    if (size < 1e-12) return;
    for (const sign of [1, -1]) {
      const inward = scaled(n, sign / size);
      if (edges.every((e) => dot(inward, e.ray) > -1e-12)) facets.push({ inward, between: [a, b] });
    }
  }));
  return { edges, facets, normals };
}
// angle (rad) from the load to the nearest facet, and that facet; negative outside
function marginOf(cone, load) {
  const f = unitOf(load);
  let least = { margin: Math.PI, facet: null };
  for (const facet of cone.facets) {
    const margin = Math.asin(Math.max(-1, Math.min(1, dot(facet.inward, f))));
    if (margin < least.margin) least = { margin, facet };
  }
  return least;
}
// what gives at a face of the cone: at its apex, or where the force that is nearest to the load has these edges
function faceWords(between, fingers) {
  const [a, b] = between;
  if (!a) return "the load pulls: no finger can";
  if (fingers < 2) return "the finger slips";
  if (!b || a.finger === b.finger) return "finger " + (2 - a.finger) + " lets go" + (b ? "" : ", finger " + (a.finger + 1) + " slips");
  return a.side === b.side ? "both fingers slip to one side" : "the fingers slip, each to its side";
}
// for a load inside: what gives first, at the nearest facet; outside: at the face that holds the nearest load of the cone
function whatGives(cone, load, fingers) {
  const { margin, facet } = marginOf(cone, load), f = unitOf(load);
  if (facet && margin >= 0) return faceWords(facet.between, fingers);
  // fingers push: a force that has no part along any of their normals is out of their reach
  if (cone.normals.every((n) => n[0] * f[0] + n[1] * f[1] <= 0)) return faceWords([], fingers);
  let nearest = { left: 1, between: [] };
  const consider = (part, between) => {
    const left = Math.hypot(...f.map((v, k) => v - part[k]));
    if (left < nearest.left) nearest = { left, between };
  };
  for (const e of cone.edges) consider(scaled(e.ray, Math.max(0, dot(e.ray, f))), [e]);
  for (const { inward, between } of cone.facets) {
    const part = f.map((v, k) => v - dot(inward, f) * inward[k]), [a, b] = between.map((e) => e.ray), c = dot(a, b);
    // shares of the two edges in the load that is nearest in the plane of the facet
    if (dot(a, part) >= c * dot(b, part) && dot(b, part) >= c * dot(a, part)) consider(part, between);
  }
  return faceWords(nearest.between, fingers);
}
