// Programs and buffers of WebGL 2: colored triangles, thin lines, and lines of any width.

const COLORS = `
uniform vec3 map[11];
uniform vec2 range;
uniform vec3 missing;
vec3 colorOf(float value) {
  if (value > 1e29) return missing;
  float place = clamp((value - range.x) / (range.y - range.x), 0.0, 1.0) * 10.0;
  int lower = min(int(place), 9);
  return mix(map[lower], map[lower + 1], place - float(lower));
}`;

const HEAD = "#version 300 es\nprecision highp float;\n";

// `clip` are the normal and the offset of a plane; what is beyond is not drawn.
const SOURCES = {
  triangles: [
    `uniform mat4 view; in vec3 position; in float value; out vec3 place; out float shown;
void main() { place = position; shown = value; gl_Position = view * vec4(position, 1.0); }`,
    `uniform vec4 clip; uniform vec3 light; uniform bool plain; in vec3 place; in float shown; out vec4 color;${COLORS}
void main() {
  if (dot(clip.xyz, place) > clip.w) discard;
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  vec3 own = plain ? missing : colorOf(shown);
  // The inside of a surface that is cut open is pale.
  if (!gl_FrontFacing) own = mix(own, vec3(0.55), 0.55);
  color = vec4(own * (0.74 + 0.26 * abs(dot(normal, light))), 1.0);
}`,
  ],
  lines: [
    `uniform mat4 view; in vec3 position; out vec3 place;
void main() { place = position; gl_Position = view * vec4(position, 1.0); }`,
    `uniform vec4 clip; uniform vec4 ink; in vec3 place; out vec4 color;
void main() { if (dot(clip.xyz, place) > clip.w) discard; color = ink; }`,
  ],
  // One instance for each line, as a rectangle of `width` pixels; `lift` moves it toward the viewer.
  wide: [
    `uniform mat4 view; uniform vec2 size; uniform float width; uniform float lift;
in vec3 from; in vec3 to; in float value; out vec3 place; out float shown; out float depth;
void main() {
  float along = float(gl_VertexID >> 1), side = float(gl_VertexID & 1) * 2.0 - 1.0;
  vec4 a = view * vec4(from, 1.0), b = view * vec4(to, 1.0);
  vec2 direction = (b.xy - a.xy) * size;
  direction = length(direction) > 0.0 ? normalize(direction) : vec2(1.0, 0.0);
  vec4 p = mix(a, b, along);
  p.xy += (vec2(-direction.y, direction.x) * side + direction * (along * 2.0 - 1.0) * 0.5) * width / size;
  p.z -= lift;
  place = mix(from, to, along); shown = value; depth = p.z; gl_Position = p;
}`,
    `uniform vec4 clip; uniform vec4 ink; uniform vec4 fade; in vec3 place; in float shown; in float depth; out vec4 color;${COLORS}
void main() {
  if (dot(clip.xyz, place) > clip.w) discard;
  vec3 own = ink.a > 0.0 ? ink.rgb : colorOf(shown);
  // Far lines fade toward the background.
  color = vec4(mix(own, fade.rgb, fade.a * clamp(0.5 + 0.5 * depth, 0.0, 1.0)), 1.0);
}`,
  ],
};

const VIRIDIS = [[68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140], [34, 168, 132],
  [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37]];
// Blue below, gray in the middle, red above.
const DIVERGING = [[22, 78, 150], [33, 102, 172], [68, 136, 190], [103, 169, 207], [140, 176, 198], [165, 170, 176], [202, 160, 143],
  [239, 138, 98], [214, 84, 71], [190, 30, 45], [150, 15, 40]];
const gradient = (map) => `linear-gradient(to right,${map.map((c) => `rgb(${c})`).join(",")})`;

class Painter {
  // Returns null without WebGL 2.
  static of(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    return gl && new Painter(canvas, gl);
  }

  constructor(canvas, gl) {
    Object.assign(this, { canvas, gl, programs: {}, buffers: new Map() });
    for (const [name, sources] of Object.entries(SOURCES)) this.programs[name] = this.link(sources);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  link(sources) {
    const gl = this.gl;
    const program = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((type, k) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, HEAD + sources[k]);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  // Gives the canvas as many pixels as the screen has there, and returns its aspect ratio.
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.ratio = ratio;
    return width / height;
  }

  clear(color) {
    const gl = this.gl;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...color.map((x) => x / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  // Copies numbers to a buffer of this name.
  upload(name, numbers, isIndex = false) {
    const gl = this.gl;
    const target = isIndex ? gl.ELEMENT_ARRAY_BUFFER : gl.ARRAY_BUFFER;
    if (!this.buffers.has(name)) this.buffers.set(name, gl.createBuffer());
    gl.bindBuffer(target, this.buffers.get(name));
    gl.bufferData(target, numbers, gl.DYNAMIC_DRAW);
  }

  // Makes a program current and sets its uniforms: numbers, arrays of two to four numbers, a matrix, or a list of colors.
  use(name, uniforms) {
    const gl = this.gl;
    this.program = this.programs[name];
    gl.useProgram(this.program);
    for (const [key, value] of Object.entries(uniforms)) {
      const place = gl.getUniformLocation(this.program, key);
      if (key === "plain") gl.uniform1i(place, value);
      else if (key === "map") gl.uniform3fv(place, value.flat().map((x) => x / 255));
      else if (typeof value === "number") gl.uniform1f(place, value);
      else if (value.length === 16) gl.uniformMatrix4fv(place, false, value);
      else gl[`uniform${value.length}fv`](place, value);
    }
  }

  // Binds a buffer to an attribute: `size` numbers each, `stride` and `start` counted in numbers.
  attribute(name, buffer, size, { stride = 0, start = 0, divisor = 0 } = {}) {
    const gl = this.gl;
    const place = gl.getAttribLocation(this.program, name);
    if (place < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.get(buffer));
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * stride, 4 * start);
    gl.vertexAttribDivisor(place, divisor);
  }

  // Draws one instance for each seven numbers of a buffer: both ends and a value.
  wideLines(buffer, count) {
    const place = (start) => ({ stride: 7, start, divisor: 1 });
    this.attribute("from", buffer, 3, place(0));
    this.attribute("to", buffer, 3, place(3));
    this.attribute("value", buffer, 1, place(6));
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, count);
    for (const name of ["from", "to", "value"]) {
      const own = this.gl.getAttribLocation(this.program, name);
      if (own >= 0) this.gl.vertexAttribDivisor(own, 0);
    }
  }
}
