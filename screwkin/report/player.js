// Plays the motions of a report: the robot in three dimensions, and plots in step with time.
// The page holds everything: data and library are deflated, no network is used.
(async () => {
  "use strict";
  const element = (id) => document.getElementById(id);
  const section = element("player");
  const inflated = async (id) => {
    const bytes = Uint8Array.from(atob(element(id).textContent.trim()), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  if (typeof DecompressionStream === "undefined") return; // the pictures below say the same

  // Arrays: whole numbers, differences along the first axis, all first bytes, then all second bytes, and so on.
  const header = JSON.parse(element("player-header").textContent);
  const blob = await inflated("player-data");
  const array = ({ offset, shape, scale }) => {
    const count = shape.reduce((a, b) => a * b, 1), row = count / Math.max(shape[0], 1);
    const whole = new Int32Array(count), values = new Float64Array(count);
    for (let i = 0; i < count; i++)
      whole[i] = blob[offset + i] | (blob[offset + count + i] << 8) | (blob[offset + 2 * count + i] << 16) | (blob[offset + 3 * count + i] << 24);
    for (let i = row; i < count; i++) whole[i] = (whole[i] + whole[i - row]) | 0;
    for (let i = 0; i < count; i++) values[i] = whole[i] === -2147483648 ? NaN : whole[i] * scale;
    return values;
  };
  const motions = header.motions.map((m) => ({ ...m, ...Object.fromEntries(Object.entries(m.arrays).map(([k, a]) => [k, array(a)])) }));
  let motion = motions[0], now = 0, playing = false, speed = 1, before = 0;
  const end = () => motion.time[motion.time.length - 1];
  const sample = (m, t) => {
    let low = 0, high = m.time.length - 1;
    while (low < high) { const middle = (low + high) >> 1; if (m.time[middle] < t) low = middle + 1; else high = middle; }
    return low > 0 && t - m.time[low - 1] <= m.time[low] - t ? low - 1 : low;
  };

  // The robot: every link's triangles in the zero pose, carried by the displacements of the screws above it.
  const view = element("player-view");
  let scene3d = null;
  try {
    const THREE = new Function(new TextDecoder().decode(await inflated("player-three")) + ";return THREE")();
    scene3d = robot(THREE);
  } catch (error) {
    view.hidden = true;
    element("player-without").hidden = false; // no WebGL: plots and numbers play all the same
  }

  function robot(THREE) {
    const renderer = new THREE.WebGLRenderer({ canvas: view, antialias: true, alpha: true });
    const camera = new THREE.PerspectiveCamera(38, 1.5, 0.01, 100), scene = new THREE.Scene();
    const { size, middle, radius, joints, links, pieces, tile } = header.robot;
    camera.up.set(0, 0, 1);
    const wide = view.clientWidth / Math.max(view.clientHeight, 1), half = Math.tan((19 * Math.PI) / 180);
    const away = radius / Math.sin(Math.atan(half * Math.min(wide || 1, 1))); // all of the robot, in a narrow page too
    camera.position.set(0.62, -0.7, 0.35).setLength(away).add(new THREE.Vector3(0, 0, middle));
    const orbit = new THREE.OrbitControls(camera, view);
    orbit.target.set(0, 0, middle);
    orbit.enableZoom = true;
    scene.add(new THREE.AmbientLight(0xffffff, 1.7));
    const lamp = new THREE.DirectionalLight(0xffffff, 2.2);
    lamp.position.set(0.6, -1, 1.6);
    scene.add(lamp);
    const world = new THREE.Group();
    scene.add(world);
    const lines = []; // of the floor, tile by tile: software renderers lose lines that end behind the camera
    for (let i = -40; i <= 40; i++) for (let j = -40; j < 40; j++)
      lines.push(i * tile, j * tile, 0, i * tile, (j + 1) * tile, 0, j * tile, i * tile, 0, (j + 1) * tile, i * tile, 0);
    const tiles = new THREE.BufferGeometry();
    tiles.setAttribute("position", new THREE.BufferAttribute(new Float32Array(lines), 3));
    world.add(new THREE.LineSegments(tiles, new THREE.LineBasicMaterial({ color: 0xaab1bc })));
    const bodies = links.map(() => { const g = new THREE.Group(); g.matrixAutoUpdate = false; world.add(g); return g; });
    const still = new THREE.Group();
    world.add(still);
    for (const piece of pieces) {
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(array(piece.vertices)), 3));
      shape.setIndex(new THREE.BufferAttribute(new Uint32Array(array(piece.faces)), 1));
      const [r, g, b] = piece.colour;
      const paint = new THREE.MeshLambertMaterial({ color: new THREE.Color(`rgb(${r},${g},${b})`), flatShading: true, side: THREE.DoubleSide });
      (piece.link < 0 ? still : bodies[piece.link]).add(new THREE.Mesh(shape, paint));
    }
    const ball = (colour) => {
      const mesh = new THREE.Mesh(new THREE.SphereGeometry(0.018 * size, 16, 12), new THREE.MeshBasicMaterial({ color: colour }));
      world.add(mesh);
      return mesh;
    };
    const line = (colour, Kind) => {
      const one = new Kind(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour }));
      one.frustumCulled = false;
      world.add(one);
      return one;
    };
    const zmp = ball(0xa6266e), com = ball(0x2b7850), polygon = line(0x50607a, THREE.LineLoop);
    const traces = { zmp: line(0xa6266e, THREE.Line), com: line(0x2b7850, THREE.Line) };
    const points = (flat) => new THREE.BufferAttribute(new Float32Array(flat), 3);
    const matrix = new THREE.Matrix4(), axis = new THREE.Vector3(), turn = new THREE.Quaternion(), place = new THREE.Vector3();
    const one = new THREE.Vector3(1, 1, 1), base = new THREE.Matrix4();
    const carried = links.map(() => new THREE.Matrix4());

    function displacement(joint, theta) { // of a screw: a turn about its line, and its advance along it
      axis.set(...joint.s);
      const turns = joint.slides ? 0 : theta, along = joint.slides ? theta : joint.pitch * theta;
      matrix.makeRotationAxis(axis, turns);
      place.set(...joint.s0).applyMatrix4(matrix);
      return matrix.setPosition(joint.s0[0] - place.x + along * joint.s[0], joint.s0[1] - place.y + along * joint.s[1], joint.s0[2] - place.z + along * joint.s[2]);
    }

    let path = [], shown = null;
    function begin() { // traces, and the way that the camera goes along
      const m = motion, count = m.time.length;
      shown = m;
      const flat = [];
      for (let k = 0; k < count; k++) flat.push(m.zmp[2 * k], m.zmp[2 * k + 1], 0.002 * size);
      traces.zmp.geometry.setAttribute("position", points(flat.map((x) => (Number.isNaN(x) ? 0 : x))));
      traces.zmp.visible = !flat.some(Number.isNaN);
      traces.com.visible = !!m.com;
      if (m.com) traces.com.geometry.setAttribute("position", points(m.com));
      path = [[m.base[0], m.base[1]]];
      for (let k = 1; k < count; k++) {
        const share = 1 - Math.exp(-(m.time[k] - m.time[k - 1]) / 0.6), [x, y] = path[k - 1];
        path.push([x + share * (m.base[3 * k] - x), y + share * (m.base[3 * k + 1] - y)]);
      }
    }

    return function draw(k) {
      if (shown !== motion) begin();
      const m = motion, n = header.robot.coordinates;
      for (const l of header.robot.roots) carried[l].identity();
      for (const joint of joints) {
        const theta = joint.ratio * m.q[k * n + joint.coordinate] + joint.offset;
        carried[joint.child].multiplyMatrices(carried[joint.parent], displacement(joint, theta));
      }
      turn.set(m.turn[4 * k], m.turn[4 * k + 1], m.turn[4 * k + 2], m.turn[4 * k + 3]).normalize();
      base.compose(place.set(m.base[3 * k], m.base[3 * k + 1], m.base[3 * k + 2]), turn, one);
      bodies.forEach((body, l) => { body.matrix.multiplyMatrices(base, carried[l]); body.matrixWorldNeedsUpdate = true; });
      zmp.visible = !Number.isNaN(m.zmp[2 * k]);
      zmp.position.set(m.zmp[2 * k], m.zmp[2 * k + 1], 0);
      com.visible = !!m.com;
      if (m.com) com.position.set(m.com[3 * k], m.com[3 * k + 1], m.com[3 * k + 2]);
      const phase = header.phases.find((p) => m.time[k] >= p.begin && m.time[k] < p.end) || header.phases[header.phases.length - 1];
      polygon.visible = !!phase;
      if (phase) polygon.geometry.setAttribute("position", points(phase.corners.flatMap(([x, y]) => [x, y, 0.001 * size])));
      world.position.set(-path[k][0], -path[k][1], 0);
      const width = view.clientWidth, height = view.clientHeight, ratio = Math.min(window.devicePixelRatio || 1, 2);
      if (view.width !== Math.round(width * ratio) || view.height !== Math.round(height * ratio)) {
        renderer.setPixelRatio(ratio);
        renderer.setSize(width, height, false);
        camera.aspect = width / height;
        camera.updateProjectionMatrix();
      }
      orbit.update();
      renderer.render(scene, camera);
    };
  }

  // Plots: lines over time, a needle where the motion is now; a press or a drag goes there.
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  function plot(canvas) {
    const rows = header.plots[canvas.dataset.plot].map((r) => ({ ...r, values: array(r.values) }));
    const times = array(header.plots.time), all = rows.flatMap((r) => [...r.values]).filter(Number.isFinite);
    const low = Math.min(0, ...[Math.min.apply(null, all.slice(0, 1)), all.reduce((a, b) => Math.min(a, b), Infinity)]), high = all.reduce((a, b) => Math.max(a, b), -Infinity);
    const go = (event) => {
      const box = canvas.getBoundingClientRect();
      if (event.buttons || event.type === "click") seek(((event.clientX - box.left - 38) / (box.width - 46)) * end());
    };
    canvas.addEventListener("click", go);
    canvas.addEventListener("pointermove", go);
    return () => {
      const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
      canvas.width = w * ratio;
      canvas.height = h * ratio;
      const c = canvas.getContext("2d");
      c.scale(ratio, ratio);
      c.font = "11px system-ui, sans-serif";
      const X = (t) => 38 + (t / end()) * (w - 46), Y = (v) => h - 18 - ((v - low) / (high - low || 1)) * (h - 44);
      c.strokeStyle = css("--line");
      c.fillStyle = css("--soft");
      for (const v of [low, (low + high) / 2, high]) {
        c.beginPath(); c.moveTo(38, Y(v)); c.lineTo(w - 8, Y(v)); c.stroke();
        c.textAlign = "right"; c.fillText(v.toFixed(Math.abs(high - low) < 10 ? 1 : 0), 34, Y(v) + 4);
      }
      c.textAlign = "center";
      for (let t = 0; t <= end(); t += Math.max(1, Math.ceil(end() / 8))) c.fillText(`${t} s`, Math.min(X(t), w - 16), h - 4);
      let at = 38, line = 10;
      c.textAlign = "left";
      for (const row of rows) {
        c.strokeStyle = c.fillStyle = row.colour;
        const width = c.measureText(row.name).width;
        if (at + width > w) { at = 38; line += 11; }
        c.fillText(row.name, at, line);
        at += width + 14;
        c.beginPath();
        row.values.forEach((v, k) => { if (Number.isFinite(v)) c.lineTo(X(times[k]), Y(v)); });
        c.stroke();
      }
      c.strokeStyle = css("--ink");
      c.beginPath(); c.moveTo(X(now), 18); c.lineTo(X(now), h - 18); c.stroke();
    };
  }
  const plots = [...section.querySelectorAll("canvas[data-plot]")].map(plot);

  const button = element("player-play"), scrubber = element("player-time"), reading = element("player-reading");
  function show() {
    const k = sample(motion, now), x = 1e3 * motion.zmp[2 * k], y = 1e3 * motion.zmp[2 * k + 1];
    const margin = motion.margin ? `, margin ${(1e3 * motion.margin[k]).toFixed(1)} mm` : "";
    element("player-clock").textContent = `${now.toFixed(2)} s`;
    reading.textContent = Number.isNaN(x) ? "no force on the floor" : `ZMP x ${x.toFixed(1)} mm, y ${y.toFixed(1)} mm${margin}`;
    scrubber.value = now;
    button.textContent = playing ? "Pause" : "Play";
    if (scene3d) scene3d(k);
    plots.forEach((draw) => draw());
  }
  function tick(at) {
    if (!playing) return;
    now = Math.min(now + (speed * Math.max(at - before, 0)) / 1000, end());
    before = at;
    if (now >= end()) playing = false;
    show();
    requestAnimationFrame(tick);
  }
  function seek(time) {
    now = Math.min(Math.max(time, 0), end());
    if (!playing) show();
  }
  button.addEventListener("click", () => {
    playing = !playing;
    if (playing && now >= end()) now = 0;
    before = performance.now();
    if (playing) requestAnimationFrame(tick);
    show();
  });
  scrubber.addEventListener("input", () => seek(Number(scrubber.value)));
  element("player-speed").addEventListener("change", (event) => { speed = Number(event.target.value); });
  const which = element("player-motion");
  motions.forEach((m, i) => which.add(new Option(m.name, i)));
  which.parentElement.hidden = motions.length < 2;
  which.addEventListener("change", () => { motion = motions[Number(which.value)]; scrubber.max = end(); seek(now); });
  view.addEventListener("pointermove", (event) => { if (event.buttons && !playing) show(); });
  view.addEventListener("wheel", () => { if (!playing) requestAnimationFrame(show); });
  window.addEventListener("resize", show);
  scrubber.max = end();
  section.hidden = false;
  show();
})();
