// The viewpoint: a parallel projection, turned by a mouse, fingers or keys.

class Camera {
  // `axes` are the directions right, up and toward the viewer; `center` and `radius` those of a sphere around everything.
  constructor(axes, center, radius) {
    Object.assign(this, { home: axes, center, radius });
    // Dragging sideways turns about the coordinate axis that points up on the page.
    const up = axes[1].map(Math.abs);
    const axis = up.indexOf(Math.max(...up));
    this.vertical = [0, 1, 2].map((k) => (k === axis ? Math.sign(axes[1][axis]) : 0));
    this.show(axes);
  }

  // Looks along new axes, at the center.
  show(axes) {
    [this.right, this.up, this.toward] = axes.map((axis) => [...axis]);
    this.target = [...this.center];
    this.half = this.radius;
  }

  // Looks against the direction of a coordinate axis (0, 1, 2), from the side of its sign.
  showAxis(axis, sign) {
    const toward = [0, 1, 2].map((k) => (k === axis ? sign : 0));
    const up = Math.abs(dot(toward, this.vertical)) > 0.9 ? [0, 1, 2].map((k) => (k === (axis + 1) % 3 ? 1 : 0)) : this.vertical;
    this.show([cross(up, toward), up, toward]);
  }

  // Fits points into a canvas of this aspect ratio (width over height), with a margin.
  fit(points, aspect) {
    const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
    for (let k = 0; k < points.length; k += 3) {
      const p = [points[k], points[k + 1], points[k + 2]];
      [dot(p, this.right), dot(p, this.up)].forEach((x, c) => {
        low[c] = Math.min(low[c], x);
        high[c] = Math.max(high[c], x);
      });
    }
    const middle = low.map((x, c) => (x + high[c]) / 2);
    const depth = dot(this.center, this.toward);
    this.target = add(add(scale(this.right, middle[0]), scale(this.up, middle[1])), scale(this.toward, depth));
    this.half = Math.max(0.56 * (high[1] - low[1]), (0.56 * (high[0] - low[0])) / aspect, 1e-12 * this.radius);
    return (high[1] - low[1]) / Math.max(high[0] - low[0], 1e-300);
  }

  turn(dx, dy) {
    const rotate = (axis, angle) => {
      const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
      for (const name of ["right", "up", "toward"]) {
        const v = this[name];
        this[name] = add(add(scale(v, cos), scale(cross(axis, v), sin)), scale(axis, dot(axis, v) * (1 - cos)));
      }
    };
    rotate(this.vertical, -dx);
    rotate(this.right, -dy);
    // Rounding errors of many small turns.
    this.toward = normalized(this.toward);
    this.right = normalized(cross(this.up, this.toward));
    this.up = cross(this.toward, this.right);
  }

  // Moves by a fraction of the height of the canvas.
  pan(dx, dy) {
    this.target = add(this.target, add(scale(this.right, -2 * this.half * dx), scale(this.up, 2 * this.half * dy)));
  }

  zoom(factor) {
    this.half = Math.min(Math.max(this.half / factor, 1e-4 * this.radius), 20 * this.radius);
  }

  // The matrix of the projection, column by column.
  matrix(aspect) {
    const rows = [
      scale(this.right, 1 / (this.half * aspect)),
      scale(this.up, 1 / this.half),
      scale(this.toward, -1 / (1.1 * this.radius)),
    ];
    const origins = [this.target, this.target, this.center];
    const last = rows.map((row, k) => -dot(row, origins[k]));
    return new Float32Array([0, 1, 2].flatMap((c) => [rows[0][c], rows[1][c], rows[2][c], 0]).concat(last, 1));
  }
}

// Lets a mouse, fingers and keys move a camera; calls `changed` after each movement, and `keys` with other keys.
function control(canvas, camera, changed, reset, keys = () => false) {
  const pointers = new Map();
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return { distance: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const before = pointers.size === 2 && spread();
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const [dx, dy, height] = [event.clientX - last.x, event.clientY - last.y, canvas.clientHeight];
    if (before) {
      const after = spread();
      camera.zoom(after.distance / Math.max(before.distance, 1));
      camera.pan((after.x - before.x) / height, (after.y - before.y) / height);
    } else if (event.shiftKey || event.buttons & 6) {
      camera.pan(dx / height, dy / height);
    } else {
      camera.turn(0.008 * dx, 0.008 * dy);
    }
    changed();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => (reset(), changed()));
  // The wheel scrolls the page until the canvas is clicked.
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    camera.zoom(Math.exp(-0.0015 * event.deltaY));
    changed();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const move = event.shiftKey ? (x, y) => camera.pan(-x / 4, y / 4) : (x, y) => camera.turn(x / 4, -y / 4);
    const actions = {
      ArrowLeft: () => move(-0.5, 0), ArrowRight: () => move(0.5, 0), ArrowUp: () => move(0, 0.5), ArrowDown: () => move(0, -0.5),
      "+": () => camera.zoom(1.2), "=": () => camera.zoom(1.2), "-": () => camera.zoom(1 / 1.2), 0: reset, Home: reset,
    };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (actions[event.key]) actions[event.key]();
    else if (!keys(event.key)) return;
    event.preventDefault();
    changed();
  });
}
