// A fiber network before loading and at a step, side by side, seen from the same direction.

const CUBE_EDGES = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((a) => [1, 2, 4].filter((bit) => !(a & bit)).map((bit) => [a, a | bit]));

class Networks {
  constructor(painter, data) {
    Object.assign(this, { painter, data });
    this.setNetwork(0);
  }

  setNetwork(number) {
    const network = this.data.networks[number];
    this.network = network;
    this.fibers = integersOf(network.fibers);
    this.reference = network.reference ? unpack(network.reference) : null;
    this.setTime(network.steps[network.steps.length - 1].time);
  }

  // Shows the last state of the network that is not later than a pseudo-time.
  setTime(time) {
    const steps = this.network.steps;
    const later = steps.findIndex((step) => step.time > time * (1 + 1e-12));
    this.shown = steps[later < 0 ? steps.length - 1 : Math.max(later - 1, 0)];
    this.nodes = unpack(this.shown.nodes);
    this.stretch = unpack(this.shown.stretch);
    this.sides = this.reference ? [this.side(this.reference, null), this.side(this.nodes, this.stretch)] : [this.side(this.nodes, this.stretch)];
  }

  // Lines of the fibers, with the value 1 without stretches, and of the cube around them.
  side(nodes, stretch) {
    const lines = new Float32Array((7 * this.fibers.length) / 2);
    for (let f = 0; f < this.fibers.length / 2; f++) {
      lines.set([...at(nodes, this.fibers[2 * f]), ...at(nodes, this.fibers[2 * f + 1]), stretch ? stretch[f] : 1], 7 * f);
    }
    return { nodes, lines, cube: this.cube(nodes) };
  }

  // The edges of the cube around the network. The nodes on its faces move with the deformation gradient, which follows from
  // them by least squares.
  cube(nodes) {
    const rest = this.reference || nodes;
    const isOnFace = (k) => at(rest, k).some((x) => Math.abs(Math.abs(x) - 0.5) < 1e-4);
    const moments = [[0, 0, 0], [0, 0, 0], [0, 0, 0]], images = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    for (let k = 0; k < rest.length / 3; k++) {
      if (!isOnFace(k)) continue;
      const [X, x] = [at(rest, k), at(nodes, k)];
      for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) {
        moments[i][j] += X[i] * X[j];
        images[i][j] += x[i] * X[j];
      }
    }
    const [a, b, c] = moments;
    const cofactors = [cross(b, c), cross(c, a), cross(a, b)];
    const determinant = dot(a, cofactors[0]);
    if (!(Math.abs(determinant) > 1e-12)) return new Float32Array(0);
    const moved = (corner) => {
      const X = [0, 1, 2].map((k) => ((corner >> k) & 1) - 0.5);
      const weights = [0, 1, 2].map((k) => dot(cofactors[k], X) / determinant);
      return images.map((row) => dot(row, weights));
    };
    return new Float32Array(CUBE_EDGES.flatMap((edge) => edge.flatMap(moved)));
  }

  allPoints() {
    return this.sides.reduce((all, side) => joined(all, joined(side.nodes, side.cube)), new Float32Array(0));
  }

  draw(camera, theme) {
    const { painter, sides } = this;
    const gl = painter.gl;
    painter.resize();
    painter.clear(theme.background);
    const width = Math.floor(painter.canvas.width / sides.length), height = painter.canvas.height;
    const view = camera.matrix(width / height);
    const fade = [...theme.background.map((x) => x / 255), 0.6];
    // Dense networks have thin lines.
    const line = Math.min(2.4, Math.max(0.9, 40 / Math.sqrt(this.fibers.length / 2))) * painter.ratio;
    sides.forEach((side, k) => {
      gl.viewport(k * width, 0, width, height);
      painter.upload("cube", side.cube);
      painter.use("lines", { view, clip: NO_CLIP, ink: theme.outline });
      painter.attribute("position", "cube", 3);
      gl.enable(gl.BLEND);
      gl.drawArrays(gl.LINES, 0, side.cube.length / 3);
      gl.disable(gl.BLEND);
      painter.upload("fibers", side.lines);
      painter.use("wide", { view, clip: NO_CLIP, size: [width, height], width: line, lift: 0, ink: [0, 0, 0, 0], fade,
        range: this.range(), map: DIVERGING, missing: [0.6, 0.6, 0.6] });
      painter.wideLines("fibers", side.lines.length / 7);
    });
  }

  // The range of the colors is symmetric about the stretch 1.
  range() {
    const [low, high] = this.data.range;
    const span = Math.max(1 - low, high - 1, 1e-6);
    return [1 - span, 1 + span];
  }

  // The stretch of the fiber within six pixels of a place of the canvas, in pixels from its top left corner.
  fiberUnder(camera, x, y, width, height) {
    const own = width / this.sides.length;
    const number = Math.min(Math.floor(x / own), this.sides.length - 1);
    const { nodes, lines } = this.sides[number];
    const origins = [dot(camera.target, camera.right), dot(camera.target, camera.up)];
    const pixels = height / 2 / camera.half;
    const across = project(nodes, camera.right, origins[0]).map((value) => own * (number + 0.5) + value * pixels);
    const up = project(nodes, camera.up, origins[1]).map((value) => height / 2 - value * pixels);
    let best = { distance: 6, fiber: -1 };
    for (let f = 0; f < this.fibers.length / 2; f++) {
      const [a, b] = [this.fibers[2 * f], this.fibers[2 * f + 1]];
      const [dx, dy] = [across[b] - across[a], up[b] - up[a]];
      const along = Math.min(1, Math.max(0, ((x - across[a]) * dx + (y - up[a]) * dy) / Math.max(dx * dx + dy * dy, 1e-12)));
      const distance = Math.hypot(x - across[a] - along * dx, y - up[a] - along * dy);
      if (distance < best.distance) best = { distance, fiber: f };
    }
    return best.fiber < 0 ? null : { fiber: best.fiber, stretch: lines[7 * best.fiber + 6] };
  }
}
