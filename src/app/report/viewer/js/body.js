// The body: its surface, cut open by a plane if wanted, the lines of its mesh, its undeformed outline and its fibers.

const NO_CLIP = [0, 0, 0, 1];
// Faces that meet at more than 35 degrees form a crease.
const CREASE = 0.82;

class Body {
  constructor(painter, data) {
    Object.assign(this, { painter, data });
    this.reference = unpack(data.reference);
    this.triangles = integersOf(data.triangles);
    this.behind = integersOf(data.behind);
    this.elements = integersOf(data.elements);
    this.edges = integersOf(data.edges);
    this.tetrahedra = integersOf(data.tetrahedra);
    this.glyphs = integersOf(data.glyphs);
    this.fields = [...data.fields, ...this.displacementFields()];
    this.clip = { axis: -1, place: 0.5, side: 1 };
    this.shows = { lines: true, outline: true, fibers: true };
    this.decoded = new Map();
    const meshLines = new Uint32Array(2 * data.meshEdges);
    for (let e = 0; e < data.meshEdges; e++) meshLines.set(this.edges.subarray(4 * e, 4 * e + 2), 2 * e);
    painter.upload("mesh lines", meshLines, true);
    this.findCreases();
    this.setStep(data.start);
  }

  // The displacement is drawn like a field; its range is that of all steps.
  displacementFields() {
    const { length, steps, displacementRange } = this.data;
    return ["", " x", " y", " z"].map((part, k) => {
      const of = (end, best) => Math[best](...steps.map((step) => step.displacement[end][k - 1]));
      const range = k === 0 ? displacementRange : [of("low", "min"), of("high", "max")];
      if (!(range[1] > range[0])) range[1] = range[0] + 1e-12;
      const name = k === 0 ? "displacement" : `displacement_${"xyz"[k - 1]}`;
      return { name, label: `displacement${part}`, unit: length.unit, factor: length.factor, range, extremes: range, component: k - 1 };
    });
  }

  findCreases() {
    const { reference, triangles, edges } = this;
    this.normals = normalsOf(reference, triangles);
    const creases = [];
    this.isCrease = new Uint8Array(edges.length / 4);
    let length = 0;
    for (let e = 0; e < this.isCrease.length; e++) {
      const [a, b, left, right] = [edges[4 * e], edges[4 * e + 1], edges[4 * e + 2], edges[4 * e + 3]];
      length += Math.hypot(...subtract(at(reference, a), at(reference, b)));
      const [m, n] = [at(this.normals, left), at(this.normals, right)];
      if (left === right || dot(m, n) < CREASE * Math.sqrt(dot(m, m) * dot(n, n))) {
        this.isCrease[e] = 1;
        creases.push(a, b);
      }
    }
    this.edgeLength = length / Math.max(this.isCrease.length, 1);
    this.creaseCount = creases.length;
    this.painter.upload("creases", new Uint32Array(creases), true);
  }

  decode(key, packed) {
    if (!this.decoded.has(key)) {
      // The numbers of a few steps stay decoded.
      if (this.decoded.size > 40) this.decoded.delete(this.decoded.keys().next().value);
      this.decoded.set(key, unpack(packed));
    }
    return this.decoded.get(key);
  }

  setStep(step) {
    this.step = step;
    this.displacement = this.decode(`${step} u`, this.data.steps[step].displacement);
    this.current = new Float32Array(this.reference.length);
    for (let k = 0; k < this.current.length; k++) this.current[k] = this.reference[k] + this.displacement[k];
    this.painter.upload("vertices", this.current);
    const { current, triangles } = this;
    const corners = new Float32Array(3 * triangles.length);
    for (let k = 0; k < triangles.length; k++) for (let c = 0; c < 3; c++) corners[3 * k + c] = current[3 * triangles[k] + c];
    this.painter.upload("corners", corners);
    this.setField(this.field || 0);
  }

  setField(field) {
    this.field = field;
    const { component, of_elements: ofElements } = this.fields[field];
    if (component !== undefined) {
      const u = this.displacement;
      const count = u.length / 3;
      this.values = Float32Array.from({ length: count }, (_, k) => (component < 0 ? Math.hypot(...at(u, k)) : u[3 * k + component]));
    } else {
      this.values = this.decode(`${this.step} ${field}`, this.data.steps[this.step].values[field]);
    }
    const { triangles, behind, values } = this;
    const ofCorners = new Float32Array(triangles.length);
    for (let k = 0; k < ofCorners.length; k++) ofCorners[k] = ofElements ? values[behind[(k / 3) | 0]] : values[triangles[k]];
    this.painter.upload("corner values", ofCorners);
    this.cutBody();
  }

  // The plane of the clip: its normal points to the part that is not drawn.
  plane() {
    const { axis, place, side } = this.clip;
    if (axis < 0) return NO_CLIP;
    const { low, high } = this.data.box;
    const normal = [0, 1, 2].map((k) => (k === axis ? side : 0));
    return [...normal, side * (low[axis] + place * (high[axis] - low[axis]))];
  }

  cutBody() {
    const ofElements = this.fields[this.field].of_elements;
    this.cut = this.clip.axis < 0 ? { positions: [], values: [], lines: [], elements: [] }
      : cutTetrahedra(this.tetrahedra, this.current, this.values, ofElements, this.plane());
    this.painter.upload("cut", new Float32Array(this.cut.positions));
    this.painter.upload("cut values", new Float32Array(this.cut.values));
    // Elements that are divided into tetrahedra have other edges than these.
    const areWhole = this.tetrahedra.length === 5 * this.elements.length;
    this.painter.upload("cut lines", new Float32Array(areWhole ? this.cut.lines : []));
    this.cutLines = areWhole ? this.cut.lines.length / 3 : 0;
  }

  // The silhouette and the creases of the undeformed body that are not behind it.
  outline(camera) {
    const { reference, edges, normals } = this;
    const [x, y, z] = camera.toward;
    const faces = new Uint8Array(normals.length / 3);
    for (let t = 0; t < faces.length; t++) faces[t] = normals[3 * t] * x + normals[3 * t + 1] * y + normals[3 * t + 2] * z > 0 ? 1 : 0;
    const lines = [];
    for (let e = 0; e < this.isCrease.length; e++) {
      const [left, right] = [faces[edges[4 * e + 2]], faces[edges[4 * e + 3]]];
      if (left !== right || (this.isCrease[e] && left + right > 0)) lines.push(...at(reference, edges[4 * e]), ...at(reference, edges[4 * e + 1]));
    }
    return new Float32Array(lines);
  }

  // The fiber directions on the visible side, seven numbers for each; of many on few pixels every `stride`-th one.
  fiberLines(camera, stride) {
    const directions = this.data.steps[this.step].directions;
    if (!directions) return new Float32Array(0);
    const codes = new Int8Array(bytesOf(directions).buffer);
    const lines = [];
    this.glyphs.forEach((t, k) => {
      const [a, b, c] = [0, 1, 2].map((corner) => at(this.current, this.triangles[3 * t + corner]));
      const direction = [codes[3 * k], codes[3 * k + 1], codes[3 * k + 2]];
      if (k % stride || dot(cross(subtract(b, a), subtract(c, a)), camera.toward) <= 0 || !direction.some((x) => x)) return;
      const middle = scale(add(add(a, b), c), 1 / 3);
      const half = scale(direction, (this.data.glyphLength * Math.sqrt(stride)) / 254);
      lines.push(...subtract(middle, half), ...add(middle, half), 0);
    });
    return new Float32Array(lines);
  }

  draw(camera, range, theme) {
    const { painter, fields } = this;
    const gl = painter.gl;
    const aspect = painter.resize();
    painter.clear(theme.background);
    const view = camera.matrix(aspect);
    const clip = this.plane();
    const light = normalized(subtract(scale(camera.toward, 0.9), scale(camera.up, 0.3)));
    const colors = { view, light, range, map: VIRIDIS, missing: [0.62, 0.66, 0.7], plain: fields.length ? 0 : 1 };
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    painter.use("triangles", { ...colors, clip });
    painter.attribute("position", "corners", 3);
    painter.attribute("value", "corner values", 1);
    gl.drawArrays(gl.TRIANGLES, 0, this.triangles.length);
    if (this.cut.values.length) {
      painter.use("triangles", { ...colors, clip: NO_CLIP });
      painter.attribute("position", "cut", 3);
      painter.attribute("value", "cut values", 1);
      gl.drawArrays(gl.TRIANGLES, 0, this.cut.values.length);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.enable(gl.BLEND);
    const inkOf = (alpha) => [0.07, 0.1, 0.14, alpha];
    const indexed = (buffer, count, ink) => {
      painter.use("lines", { view, clip, ink });
      painter.attribute("position", "vertices", 3);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, painter.buffers.get(buffer));
      gl.drawElements(gl.LINES, count, gl.UNSIGNED_INT, 0);
    };
    const direct = (buffer, count, ink) => {
      painter.use("lines", { view, clip: NO_CLIP, ink });
      painter.attribute("position", buffer, 3);
      gl.drawArrays(gl.LINES, 0, count);
    };
    if (this.shows.lines) {
      // Lines closer than a few pixels would cover the colors.
      const pixels = (this.edgeLength / camera.half) * (painter.canvas.height / 2);
      const ink = inkOf(0.45 * Math.min(1, Math.max(0, (pixels - 2) / 10)));
      if (ink[3] > 0) {
        indexed("mesh lines", 2 * this.data.meshEdges, ink);
        if (this.cutLines) direct("cut lines", this.cutLines, ink);
      }
    }
    indexed("creases", this.creaseCount, inkOf(0.8));
    if (this.shows.fibers && this.glyphs.length) {
      const pixels = ((this.data.glyphLength / camera.half) * painter.canvas.clientHeight) / 2;
      const lines = this.fiberLines(camera, Math.max(1, Math.round((9 / pixels) ** 2)));
      painter.upload("fibers", lines);
      const shared = { view, clip, size: [painter.canvas.width, painter.canvas.height], fade: [0, 0, 0, 0], range: [0, 1] };
      const lift = (0.6 * this.data.glyphLength) / (1.1 * camera.radius);
      for (const [width, ink, more] of [[3.2, [0.06, 0.09, 0.13, 1], 0], [1.7, [1, 1, 1, 1], 2e-3]]) {
        painter.use("wide", { ...shared, width: width * painter.ratio, ink, lift: lift + more });
        painter.wideLines("fibers", lines.length / 7);
      }
    }
    if (this.shows.outline) {
      const lines = this.outline(camera);
      painter.upload("outline", lines);
      gl.disable(gl.DEPTH_TEST);
      direct("outline", lines.length / 3, theme.outline);
      gl.enable(gl.DEPTH_TEST);
    }
    gl.disable(gl.BLEND);
  }
}
