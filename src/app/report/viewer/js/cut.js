// The cut of a plane through tetrahedra, and the point of the body under the pointer.

// `tetrahedra` has four vertices and the place of the element for each; `plane` the normal and the offset. Returns triangles
// with values, the element of each, and the edges of the polygons.
function cutTetrahedra(tetrahedra, points, values, ofElements, plane) {
  const cut = { positions: [], values: [], lines: [], elements: [] };
  const distances = new Float32Array(points.length / 3);
  for (let v = 0; v < distances.length; v++) distances[v] = dot(plane, at(points, v)) - plane[3];
  const between = (a, b) => {
    const part = distances[a] / (distances[a] - distances[b]);
    const point = add(at(points, a), scale(subtract(at(points, b), at(points, a)), part));
    return { point, value: ofElements ? 0 : values[a] + part * (values[b] - values[a]) };
  };
  for (let t = 0; t < tetrahedra.length; t += 5) {
    const beyond = [], before = [];
    for (let k = 0; k < 4; k++) (distances[tetrahedra[t + k]] > 0 ? beyond : before).push(tetrahedra[t + k]);
    if (!beyond.length || !before.length) continue;
    const [few, many] = beyond.length < before.length ? [beyond, before] : [before, beyond];
    const ring = few.length === 1 ? many.map((other) => between(few[0], other))
      : [[0, 0], [0, 1], [1, 1], [1, 0]].map(([a, b]) => between(few[a], many[b]));
    // The normal points to the part that is not drawn.
    const [a, b, c] = ring.map((corner) => corner.point);
    if (dot(cross(subtract(b, a), subtract(c, a)), plane) < 0) ring.reverse();
    const element = tetrahedra[t + 4];
    for (let k = 1; k + 1 < ring.length; k++) {
      for (const corner of [ring[0], ring[k], ring[k + 1]]) {
        cut.positions.push(...corner.point);
        cut.values.push(ofElements ? values[element] : corner.value);
      }
      cut.elements.push(element);
    }
    ring.forEach((corner, k) => cut.lines.push(...corner.point, ...ring[(k + 1) % ring.length].point));
  }
  return cut;
}

// Calls `visit` with the number and the weights of the corners of each triangle that covers the origin of the page.
function coveringTriangles(count, corner, across, up, visit) {
  for (let t = 0; t < count; t++) {
    const [i, j, k] = [corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)];
    const [ax, ay, bx, by, cx, cy] = [across[i], up[i], across[j], up[j], across[k], up[k]];
    const a = bx * cy - by * cx, b = cx * ay - cy * ax, c = ax * by - ay * bx;
    const sum = a + b + c;
    if (sum !== 0 && a * sum >= 0 && b * sum >= 0 && c * sum >= 0) visit(t, [i, j, k], [a / sum, b / sum, c / sum]);
  }
}

// Returns the coordinates of points on the page, relative to a point of it.
function project(points, axis, origin) {
  const [x, y, z] = axis;
  const projected = new Float64Array(points.length / 3);
  for (let k = 0; k < projected.length; k++) projected[k] = x * points[3 * k] + y * points[3 * k + 1] + z * points[3 * k + 2] - origin;
  return projected;
}

// The nearest point of the body at a place of the canvas (-1 to 1 to the right and up); null beside the body.
function pointUnder(body, camera, x, y, aspect) {
  const { current, triangles, cut, values } = body;
  const { right, up, toward, target, half } = camera;
  const origins = [dot(target, right) + x * half * aspect, dot(target, up) + y * half];
  const plane = body.plane();
  const ofElements = body.fields[body.field].of_elements;
  const mean = (numbers, corners, weights) => corners.reduce((sum, corner, k) => sum + weights[k] * numbers[corner], 0);
  let best = null;
  const search = (points, count, corner, describe) => {
    const page = [project(points, right, origins[0]), project(points, up, origins[1])];
    coveringTriangles(count, corner, ...page, (t, corners, weights) => {
      const point = [0, 1, 2].map((axis) => corners.reduce((sum, v, k) => sum + weights[k] * points[3 * v + axis], 0));
      const depth = dot(point, toward);
      if ((!best || depth > best.depth) && (points === cut.positions || dot(plane, point) <= plane[3])) {
        best = { depth, point, ...describe(t, corners, weights) };
      }
    });
  };
  search(current, triangles.length / 3, (k) => triangles[k], (t, corners, weights) => ({
    element: body.behind[t],
    value: ofElements ? values[body.behind[t]] : mean(values, corners, weights),
    displacement: [0, 1, 2].map((axis) => corners.reduce((sum, v, k) => sum + weights[k] * body.displacement[3 * v + axis], 0)),
  }));
  search(cut.positions, cut.elements.length, (k) => k, (t, corners, weights) => ({
    element: cut.elements[t],
    value: mean(cut.values, corners, weights),
  }));
  return best;
}
