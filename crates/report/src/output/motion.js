// Draws a moving surface with plotly.js. `data` is described in `moving_surface.rs`.
function start(data) {
  const find = (id) => document.getElementById(id);
  const place = find("motion");
  if (!window.Plotly) { return; }
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const rest = new Float32Array(bytes(data.positions));
  const corners = new Uint32Array(bytes(data.triangles));
  const count = rest.length / 3;
  // Triangles without common vertices have sharp edges. Many triangles share them, to be drawn in time.
  const sharp = corners.length <= 60000;
  const drawn = sharp ? corners : Uint32Array.from({ length: count }, (_, node) => node);
  const sides = [[], [], []];
  for (let corner = 0; corner < corners.length; corner += 1) { sides[corner % 3].push(sharp ? corner : corners[corner]); }
  const dark = window.matchMedia("(prefers-color-scheme: dark)");

  // The mean over the period is not drawn; a single instant has none.
  const motions = data.motions.map((motion) => {
    const moves = new Float32Array(bytes(motion.displacements));
    let largest = 0;
    for (let i = 0; i < 3 * count; i += 1) {
      let sum = 0;
      for (let k = 0; k < motion.instants; k += 1) { sum += moves[3 * count * k + i]; }
      const mean = motion.instants > 1 ? sum / motion.instants : 0;
      for (let k = 0; k < motion.instants; k += 1) { moves[3 * count * k + i] -= mean; }
    }
    for (let i = 0; i < moves.length; i += 3) { largest = Math.max(largest, Math.hypot(moves[i], moves[i + 1], moves[i + 2])); }
    return { moves, instants: motion.instants, states: new Uint8Array(bytes(motion.contact)), largest: largest || 1 };
  });
  const ends = [0, 1, 2].map((offset) => {
    let [low, high] = [Infinity, -Infinity];
    for (let i = offset; i < rest.length; i += 3) { low = Math.min(low, rest[i]); high = Math.max(high, rest[i]); }
    return [low, high];
  });
  const diameter = Math.hypot(...ends.map(([low, high]) => high - low)) || 1;

  let phase = 0;
  const current = () => motions[find("which").selectedIndex];
  // At scale 0 the largest displacement is a tenth of the diameter.
  const gain = () => 10 ** Number(find("scale").value) * 0.1 * diameter / current().largest;

  /** Returns positions, sizes of the displacements, and contact states at the present time. */
  const now = () => {
    const { moves, instants, states, largest } = current();
    const at = phase * instants;
    const [first, part] = [Math.floor(at) % instants, at % 1];
    const [a, b, factor] = [3 * count * first, 3 * count * ((first + 1) % instants), gain()];
    const move = (i) => (1 - part) * moves[a + i] + part * moves[b + i];
    // in thousandths of the diameter: plotly.js takes face normals below 1e-6 for those of degenerate faces
    const unit = 1000 / diameter;
    const along = [0, 1, 2].map((offset) => Array.from({ length: count }, (_, node) => unit * (rest[3 * node + offset] + factor * move(3 * node + offset))));
    const size = Array.from({ length: count }, (_, node) => Math.hypot(move(3 * node), move(3 * node + 1), move(3 * node + 2)) / largest);
    const near = count * (part < 0.5 ? first : (first + 1) % instants);
    return { along, size, states: states.subarray(near, near + count) };
  };

  const draw = () => {
    const { along: [x, y, z], size, states } = now();
    const shade = dark.matches ? 1 : 0;
    const scale = dark.matches ? [[0, "#8a919c"], [1, "#ffd75e"]] : [[0, "#c9ced6"], [1, "#7a1f5c"]];
    const shown = corners.length > 0 ? Array.from(states.keys()).filter((node) => states[node] > 0) : Array.from(states.keys());
    const of = (values) => Array.from(drawn, (node) => values[node]);
    const surface = { type: "mesh3d", x: of(x), y: of(y), z: of(z), i: sides[0], j: sides[1], k: sides[2], intensity: of(size), cmin: 0, cmax: 1, colorscale: scale, showscale: false, hoverinfo: "skip", lighting: { ambient: 0.75, diffuse: 0.7, specular: 0.05 } };
    const marks = { type: "scatter3d", mode: "markers", x: shown.map((n) => x[n]), y: shown.map((n) => y[n]), z: shown.map((n) => z[n]), hoverinfo: "skip", marker: { size: 5, color: shown.map((n) => states[n] > 0 ? data.states[states[n] - 1][shade] : scale[0][1]) } };
    // The box has room for the motion, so that it does not change.
    const room = ends.map(([low, high]) => [1000 * low / diameter - 150, 1000 * high / diameter + 150]);
    const length = room.map(([low, high]) => high - low);
    const hidden = (range) => ({ visible: false, range, autorange: false });
    // As seen from the camera, it is as large as the picture, whose height decides the scale.
    const fit = 0.42 * Math.hypot(...length) / Math.min(Math.max(place.clientWidth / place.clientHeight, 1), 1.4);
    const layout = {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", uirevision: "view", showlegend: false,
      scene: {
        xaxis: hidden(room[0]), yaxis: hidden(room[1]), zaxis: hidden(room[2]), aspectmode: "manual", dragmode: "orbit", uirevision: "view",
        aspectratio: { x: length[0] / fit, y: length[1] / fit, z: length[2] / fit },
        camera: { eye: { x: 0.8, y: -1.2, z: 0.6 }, projection: { type: "orthographic" } },
      },
    };
    Plotly.react(place, [surface, marks], layout, { responsive: true, displaylogo: false, displayModeBar: false });
    const factor = gain();
    find("factor").textContent = "displacements × " + (factor >= 100 ? Math.round(factor).toLocaleString("en") : factor.toPrecision(3));
    find("time").value = String(phase);
  };

  for (const motion of data.motions) { find("which").add(new Option(motion.label)); }
  find("which").parentElement.hidden = motions.length === 1;
  let playing = false, last = 0, waiting = false;
  const again = () => {
    if (waiting) { return; }
    waiting = true;
    requestAnimationFrame((time) => {
      waiting = false;
      // a period takes two seconds
      if (playing) { phase = (phase + Math.min(time - last, 100) / 2000) % 1; }
      last = time;
      draw();
      if (playing) { again(); }
    });
  };
  const play = (on) => { playing = on; find("play").textContent = on ? "Pause" : "Play"; again(); };
  find("play").addEventListener("click", () => play(!playing));
  find("time").addEventListener("input", () => { phase = Number(find("time").value) % 1; play(false); });
  find("scale").addEventListener("input", again);
  find("which").addEventListener("change", again);
  dark.addEventListener("change", again);
  place.addEventListener("keydown", (event) => {
    const turn = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!turn) { return; }
    event.preventDefault();
    const { x, y, z } = place.layout.scene.camera.eye;
    const [around, above, far] = [Math.atan2(y, x) + turn[0], Math.atan2(z, Math.hypot(x, y)) + turn[1], Math.hypot(x, y, z)];
    const up = Math.min(Math.max(above, -1.5), 1.5);
    Plotly.relayout(place, { "scene.camera.eye": { x: far * Math.cos(up) * Math.cos(around), y: far * Math.cos(up) * Math.sin(around), z: far * Math.sin(up) } });
  });
  play(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
}
