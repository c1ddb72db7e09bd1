"use strict";
// The page of an animation: it draws the scene in the tag `scene` with three.js. Lengths are parts of the size of what
// is seen, with its centre at the origin. No text of the scene becomes markup: all of it is set as text.
(() => {
  const byId = (id) => document.getElementById(id);
  const scene = JSON.parse(byId("scene").textContent);
  const bytes = Uint8Array.from(atob(byId("numbers").textContent.trim()), (c) => c.charCodeAt(0));
  const numbers = new Float32Array(bytes.buffer);
  const part = ([from, count]) => numbers.subarray(from, from + count);

  const t = part(scene.t), T = t.length, N = scene.count;
  // Times count from the first instant, which is at scene.start.
  const start = t[0], end = t[T - 1], span = end - start;
  const points = scene.points.map(part);
  const forces = { R: scene.R.map(part), F: scene.F.map(part) };
  const curves = scene.curves.map((one) => ({ name: one.name, values: Float64Array.from(part(one.values), (x) => x * one.unit) }));
  // Okabe and Ito's colours, darker or lighter by what they stand on; those of many particles are all one.
  const PALETTES = {
    light: ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d00", "#7b5ea7"],
    dark: ["#4ea8e8", "#ff8540", "#2fc79a", "#e79bc6", "#f0b429", "#9ad6ff", "#cdb33a", "#b7a0e0"],
  };
  const MANY = { light: "#3f7fb5", dark: "#6fa9db" };
  // Pieces of a string or a spring; the head and the thickness of an arrow, parts of the size of the scene.
  const MANY_ARROWS = 24; // more are drawn thin, and F only where it is asked for
  const STRAND = 24, HEAD = 0.05, SHAFT = 0.0065;
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const state = { time: start, playing: false, speed: 1, mode: scene.modes.length ? Math.max(0, scene.modes.findIndex((mode) => mode.swings)) : -1, dirty: true };
  const scheme = () => (dark.matches && !state.printing ? "dark" : "light");
  const colour = (k, count) => (count > PALETTES.light.length ? MANY[scheme()] : PALETTES[scheme()][k % PALETTES.light.length]);
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const shown = (value) => {
    if (!Number.isFinite(value)) return "–";
    const text = Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3) ? value.toExponential(3) : value.toPrecision(4);
    return text.replace("-", "−");
  };

  // ---- the instant: frame k and the part w of the way to the next
  function instant(time) {
    let low = 0, high = T - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (t[middle] <= time) low = middle; else high = middle;
    }
    if (T === 1) return [0, 0];
    const gap = t[low + 1] - t[low];
    return [low, gap > 0 ? Math.min(1, Math.max(0, (time - t[low]) / gap)) : 1];
  }
  function vector(track, k, w, out) {
    if (track.length === 3) { out[0] = track[0]; out[1] = track[1]; out[2] = track[2]; return out; }
    const a = 3 * k, b = 3 * Math.min(k + 1, T - 1);
    for (let i = 0; i < 3; i++) out[i] = track[a + i] + w * (track[b + i] - track[a + i]);
    return out;
  }
  const number = (track, k, w) => track[k] + w * (track[Math.min(k + 1, T - 1)] - track[k]);

  // ---- three.js
  const stage = byId("stage"), canvas = byId("view");
  let three = null;
  const renderer = renderers();
  if (renderer) {
    three = begin();
    byId("poster").remove();
  } else {
    canvas.hidden = true;
    byId("lost").hidden = false;
  }

  function renderers() { // none where there is no WebGL
    if (!document.createElement("canvas").getContext("webgl2")) return null;
    try {
      return new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    } catch (error) {
      return null;
    }
  }

  function begin() {
    const world = new THREE.Scene(), view = scene.view;
    const up = new THREE.Vector3(...view.up), towards = new THREE.Vector3(...view.towards);
    const camera = new THREE.PerspectiveCamera(30, 1, 0.01, 200);
    camera.up.copy(up);
    const sky = new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2), sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sky.position.copy(up);
    world.add(sky, camera);
    camera.add(sun);
    sun.position.set(-1, 1.5, 1);
    const controls = new THREE.OrbitControls(camera, canvas);
    controls.enableDamping = false;
    controls.addEventListener("change", () => { state.dirty = true; });
    return { renderer, world, camera, controls, up, towards, parts: fill(world) };
  }

  function lookAtAll() {
    const { camera, controls, up, towards } = three;
    const width = stage.clientWidth || 1, height = stage.clientHeight || 1;
    camera.aspect = width / height;
    const half = Math.tan((camera.fov * Math.PI) / 360);
    const right = new THREE.Vector3().crossVectors(up, towards).normalize();
    const above = new THREE.Vector3().crossVectors(towards, right).normalize();
    const place = new THREE.Vector3();
    let distance = 0.05;
    const reach = (p, pad) => { // the camera stands far enough for this place
      const depth = p.dot(towards);
      distance = Math.max(distance,
        depth + (Math.abs(p.dot(right)) + pad) / (half * camera.aspect), depth + (Math.abs(p.dot(above)) + pad) / half);
    };
    for (const track of [...points, ...scene.modes.map((mode) => part(mode.points))]) {
      for (let i = 0; i < track.length; i += 3) reach(place.set(track[i], track[i + 1], track[i + 2]), 0.1);
    }
    for (const track of Object.values(forces).flatMap((all) => all.map((force, i) => [force, points[i]]))) {
      const [force, at] = track, frames = force.length > 3 || at.length > 3 ? T : 1;
      for (let k = 0; k < frames; k++) {
        const f = force.length > 3 ? 3 * k : 0, p = at.length > 3 ? 3 * k : 0;
        const size = Math.hypot(force[f], force[f + 1], force[f + 2]);
        if (size > 0.6) continue; // a rare blow runs out of the picture
        reach(place.set(...[0, 1, 2].map((i) => at[p + i] + force[f + i])), 0.03);
      }
    }
    for (const one of scene.surfaces) {
      const m = part(one.frames);
      for (let f = 0; one.places && f < T; f++) {
        for (let i = 0; i < one.count; i++) {
          corner(one, f, 0, i, place);
          if (place.length() < 2) reach(place, 0.02);
        }
        if (!one.places.some(([, length]) => length > one.count)) break;
      }
      for (const [a, b, c] of one.corners) {
        for (let i = 0; i < 3; i++) place.setComponent(i, m[9 + i] + a * m[i] + b * m[3 + i] + c * m[6 + i]);
        if (place.length() < 2) reach(place, 0.02);
      }
      const rims = one.kind === "sphere" || one.kind === "cylinder" || one.kind === "circle"
        ? [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]] : [];
      for (const [a, b, c] of rims) {
        for (let at = 0; at < m.length; at += 12) {
          for (let i = 0; i < 3; i++) place.setComponent(i, m[at + 9 + i] + a * m[at + i] + b * m[at + 3 + i] + c * m[at + 6 + i]);
          if (place.length() < 3) reach(place, 0.05);
        }
      }
    }
    controls.target.set(0, 0, 0);
    camera.position.copy(towards).multiplyScalar(distance);
    camera.near = distance / 200; camera.far = distance * 40;
    camera.updateProjectionMatrix();
    controls.update();
    state.dirty = true;
  }

  // ---- what there is to see
  function fill(world) {
    const cylinder = new THREE.CylinderGeometry(1, 1, 1, 14, 1), cone = new THREE.ConeGeometry(1, 1, 18);
    const ball = new THREE.SphereGeometry(1, N > 200 ? 12 : 28, N > 200 ? 8 : 20);
    const many = (geometry, count, material) => {
      const mesh = new THREE.InstancedMesh(geometry, material, count);
      mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
      mesh.frustumCulled = false;
      world.add(mesh);
      return mesh;
    };
    const solid = (colour) => new THREE.MeshStandardMaterial({ color: colour, roughness: 0.55 });
    // Arrows lie over everything: one along a rod would be hidden in it.
    const arrow = () => new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.9, depthTest: false });
    const parts = { surfaces: [], trails: null };
    parts.balls = many(ball, Math.max(N, 1), solid("#ffffff"));
    parts.balls.count = N;
    const rods = scene.links.filter((link) => link.kind === "rod");
    parts.rods = { links: rods, mesh: many(cylinder, Math.max(rods.length, 1), solid("#888888")) };
    parts.rods.mesh.count = rods.length;
    const soft = scene.links.filter((link) => link.kind !== "rod");
    const strands = new THREE.BufferGeometry();
    strands.setAttribute("position", new THREE.BufferAttribute(new Float32Array(soft.length * STRAND * 6), 3));
    parts.soft = { links: soft, mesh: new THREE.LineSegments(strands, new THREE.LineBasicMaterial({})) };
    parts.soft.mesh.frustumCulled = false;
    world.add(parts.soft.mesh);
    const anchors = new Set(scene.links.flatMap((link) => [link.a, link.b]).filter((point) => point >= N));
    parts.anchors = { points: [...anchors], mesh: many(ball, Math.max(anchors.size, 1), solid("#888888")) };
    parts.anchors.mesh.count = anchors.size;
    for (const kind of ["R", "F"]) {
      const count = Math.max(forces[kind].length, 1);
      parts[kind] = { shafts: many(cylinder, count, arrow()), heads: many(cone, count, arrow()) };
      parts[kind].shafts.renderOrder = parts[kind].heads.renderOrder = 10;
      parts[kind].shafts.count = parts[kind].heads.count = forces[kind].length;
    }
    for (const one of scene.surfaces) parts.surfaces.push(surface(one, world));
    parts.trails = trails(world);
    return parts;
  }

  function surface(one, world) {
    const group = new THREE.Group(), frames = part(one.frames);
    group.matrixAutoUpdate = false;
    const face = new THREE.MeshLambertMaterial({ transparent: true, opacity: one.oneSided ? 0.16 : 0.2, side: THREE.DoubleSide, depthWrite: false });
    const edge = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.75 });
    const corners = one.corners.map((corner) => new THREE.Vector3(...corner));
    const ring = [];
    for (let i = 0; i <= 96; i++) ring.push(new THREE.Vector3(Math.cos((i * Math.PI) / 48), Math.sin((i * Math.PI) / 48), 0));
    const line = (list) => group.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(list), edge));
    if (one.kind === "plane") {
      const list = [];
      for (let i = 2; i < corners.length; i++) list.push(corners[0], corners[i - 1], corners[i]);
      const geometry = new THREE.BufferGeometry().setFromPoints(list);
      geometry.computeVertexNormals();
      group.add(new THREE.Mesh(geometry, face));
      line([...corners, corners[0]]);
    } else if (one.kind === "sphere") {
      group.add(new THREE.Mesh(new THREE.SphereGeometry(1, 64, 40), face));
      for (const turn of [[0, 0, 0], [Math.PI / 2, 0, 0], [0, Math.PI / 2, 0]]) {
        const circle = new THREE.Line(new THREE.BufferGeometry().setFromPoints(ring), edge);
        circle.rotation.set(...turn);
        group.add(circle);
      }
    } else if (one.kind === "cylinder") {
      const tube = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 2, 64, 1, true), face);
      tube.rotation.x = Math.PI / 2;
      group.add(tube);
      for (const z of [-1, 1]) line(ring.map((p) => new THREE.Vector3(p.x, p.y, z)));
    } else if (one.kind === "circle") {
      line(ring);
    }
    if (one.kind === "sphere" || one.kind === "cylinder") edge.opacity = 0.3;
    if (one.kind === "net") edge.opacity = 0.25;
    const bends = one.places ? bent(one, group, face, edge) : null;
    world.add(group);
    return { group, face, edge, frames, bends };
  }

  // Place i of a line or a net at an instant; NaN where there is none.
  function corner(one, k, w, i, out) {
    one.places.forEach((track, axis) => {
      const all = part(track), moves = all.length > one.count;
      const a = moves ? k * one.count + i : i, b = moves ? Math.min(k + 1, T - 1) * one.count + i : i;
      out.setComponent(axis, all[a] + w * (all[b] - all[a]));
    });
    return out;
  }
  // The meshes of a line or a net, and the function that bends them; squares and pieces without a place vanish.
  function bent(one, group, face, edge) {
    const side = Math.round(Math.sqrt(one.count)), faces = [], pieces = [];
    if (one.kind === "line") {
      for (let i = 0; i + 1 < one.count; i++) pieces.push([i, i + 1]);
    } else {
      for (let i = 0; i + 1 < side; i++) {
        for (let j = 0; j + 1 < side; j++) {
          const a = side * i + j, b = a + side, c = b + 1, d = a + 1;
          faces.push([a, b, c], [a, c, d]);
          pieces.push([a, b], [b, c], [c, d], [d, a]);
        }
      }
    }
    const buffer = (list, of) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * of * list.length), 3));
      return geometry;
    };
    const net = new THREE.Mesh(buffer(faces, 3), face), lines = new THREE.LineSegments(buffer(pieces, 2), edge);
    net.frustumCulled = lines.frustumCulled = false;
    if (faces.length) group.add(net);
    group.add(lines);
    const places = [...Array(one.count)].map(() => new THREE.Vector3());
    const fill = (list, geometry) => {
      const out = geometry.attributes.position;
      let at = 0;
      for (const some of list) {
        const there = some.every((i) => Number.isFinite(places[i].x + places[i].y + places[i].z));
        for (const i of some) { if (there) out.setXYZ(at, places[i].x, places[i].y, places[i].z); else out.setXYZ(at, 0, 0, 0); at += 1; }
      }
      out.needsUpdate = true;
    };
    const moves = one.places.some(([, length]) => length > one.count);
    let first = true;
    return (k, w) => {
      if (!moves && !first) return;
      first = false;
      places.forEach((place, i) => corner(one, k, w, i, place));
      fill(pieces, lines.geometry);
      if (!faces.length) return;
      fill(faces, net.geometry);
      net.geometry.computeVertexNormals();
    };
  }

  function trails(world) {
    if (T < 2 || !N || scene.modes.length) return null;
    // Segments in the order of time, those of all particles one after another: a window of time is one range.
    const moving = [...Array(N).keys()].filter((k) => points[k].length > 3);
    const place = new Float32Array((T - 1) * moving.length * 6), tint = new Float32Array(place.length);
    let at = 0;
    for (let f = 0; f + 1 < T; f++) {
      for (const k of moving) {
        for (let j = 0; j < 6; j++) place[at + j] = points[k][3 * f + j];
        at += 6;
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(place, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(tint, 3));
    const mesh = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.7 }));
    mesh.frustumCulled = false;
    mesh.visible = N <= 24;
    world.add(mesh);
    // The way from the last frame to the place now.
    const rest = new THREE.BufferGeometry();
    rest.setAttribute("position", new THREE.BufferAttribute(new Float32Array(moving.length * 6), 3));
    rest.setAttribute("color", new THREE.BufferAttribute(new Float32Array(moving.length * 6), 3));
    const last = new THREE.LineSegments(rest, mesh.material);
    last.frustumCulled = false;
    mesh.add(last);
    const tints = [geometry.attributes.color, rest.attributes.color];
    return { mesh, last: rest.attributes.position, moving, each: 2 * moving.length, tints };
  }

  // ---- one instant into the meshes
  const ends = [[0, 0, 0], [0, 0, 0]], here = [0, 0, 0], force = [0, 0, 0];
  const place = (point, k, w, out) => {
    if (state.mode >= 0) {
      const all = part(scene.modes[state.mode].points), P = points.length;
      const a = 3 * (k * P + point), b = 3 * (Math.min(k + 1, T - 1) * P + point);
      for (let i = 0; i < 3; i++) out[i] = all[a + i] + w * (all[b + i] - all[a + i]);
      return out;
    }
    return vector(points[point], k, w, out);
  };

  function update(k, w) {
    const { parts } = three, matrix = new THREE.Matrix4(), axis = new THREE.Vector3(), turn = new THREE.Quaternion();
    const y = new THREE.Vector3(0, 1, 0), middle = new THREE.Vector3(), size = new THREE.Vector3();
    const fine = N > MANY_ARROWS ? 0.4 : 1;
    for (let i = 0; i < N; i++) {
      place(i, k, w, here);
      const r = scene.radii[i];
      parts.balls.setMatrixAt(i, matrix.makeScale(r, r, r).setPosition(...here));
    }
    const slender = Math.min(0.008, 0.4 * Math.min(...scene.radii, 1));
    parts.rods.links.forEach((link, i) => {
      place(link.a, k, w, ends[0]); place(link.b, k, w, ends[1]);
      between(ends[0], ends[1], slender, matrix);
      parts.rods.mesh.setMatrixAt(i, matrix);
    });
    parts.anchors.points.forEach((point, i) => {
      place(point, k, w, here);
      parts.anchors.mesh.setMatrixAt(i, matrix.makeScale(2 * slender, 2 * slender, 2 * slender).setPosition(...here));
    });
    function between(a, b, radius, out) {
      axis.set(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
      const length = axis.length();
      middle.set((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2);
      turn.setFromUnitVectors(y, length ? axis.divideScalar(length) : y);
      return out.compose(middle, turn, size.set(radius, length, radius));
    }
    strands(parts.soft, k, w);
    for (const kind of ["R", "F"]) {
      const { shafts, heads } = parts[kind];
      forces[kind].forEach((track, i) => {
        place(i, k, w, here); vector(track, k, w, force);
        axis.set(...force);
        const length = axis.length(), head = Math.min(fine * HEAD, 0.45 * length), thin = Math.min(fine * SHAFT, 0.1 * length);
        turn.setFromUnitVectors(y, length > 0 ? axis.clone().divideScalar(length) : y);
        const at = (share) => middle.set(...here).addScaledVector(axis, length > 0 ? share / length : 0);
        shafts.setMatrixAt(i, matrix.compose(at((length - head) / 2), turn, size.set(thin, Math.max(length - head, 0), thin)));
        heads.setMatrixAt(i, matrix.compose(at(length - head / 2), turn, size.set(2.6 * thin, head, 2.6 * thin)));
      });
      shafts.instanceMatrix.needsUpdate = heads.instanceMatrix.needsUpdate = true;
    }
    for (const mesh of [parts.balls, parts.rods.mesh, parts.anchors.mesh]) mesh.instanceMatrix.needsUpdate = true;
    for (const one of parts.surfaces) {
      const m = one.frames, a = m.length > 12 ? 12 * k : 0, b = m.length > 12 ? 12 * Math.min(k + 1, T - 1) : 0;
      const e = (i) => m[a + i] + w * (m[b + i] - m[a + i]);
      one.group.matrix.set(e(0), e(3), e(6), e(9), e(1), e(4), e(7), e(10), e(2), e(5), e(8), e(11), 0, 0, 0, 1);
      one.group.matrixWorldNeedsUpdate = true;
      if (one.bends && one.group.visible) one.bends(k, w);
    }
    if (parts.trails && parts.trails.mesh.visible) {
      const from = instant(Math.max(start, state.time - span * Number(byId("length").value)))[0];
      const { mesh, last, moving, each } = parts.trails;
      mesh.geometry.setDrawRange(from * each, (k - from) * each);
      moving.forEach((i, j) => {
        last.setXYZ(2 * j, ...place(i, k, 0, here));
        last.setXYZ(2 * j + 1, ...place(i, k, w, here));
      });
      last.needsUpdate = true;
    }
  }

  function strands(soft, k, w) {
    const out = soft.mesh.geometry.attributes.position, view = scene.view;
    const down = view.up.map((x) => -x);
    soft.links.forEach((link, i) => {
      place(link.a, k, w, ends[0]); place(link.b, k, w, ends[1]);
      const [a, b] = ends, length = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
      const whole = link.lengths ? number(part(link.lengths), k, w) : link.length;
      const sag = link.kind === "string" ? Math.sqrt(Math.max(0, (3 / 8) * length * (whole - length))) : 0;
      const side = link.kind === "spring" ? across(a, b, view) : down;
      const at = (j) => {
        const s = j / STRAND;
        let off = 4 * sag * s * (1 - s);
        if (link.kind === "spring" && s > 0.1 && s < 0.9) off = 0.018 * (j % 2 ? 1 : -1);
        return [0, 1, 2].map((x) => a[x] + s * (b[x] - a[x]) + off * side[x]);
      };
      for (let j = 0; j < STRAND; j++) {
        out.setXYZ(2 * (i * STRAND + j), ...at(j));
        out.setXYZ(2 * (i * STRAND + j) + 1, ...at(j + 1));
      }
    });
    out.needsUpdate = true;
  }
  function across(a, b, view) {
    const along = new THREE.Vector3(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    const side = along.cross(new THREE.Vector3(...view.towards));
    return side.lengthSq() > 0 ? side.normalize().toArray() : view.up;
  }

  // ---- names
  const labels = [];
  if (three) {
    for (let k = 0; k < Math.min(N, 60); k++) {
      const span = document.createElement("span");
      span.textContent = scene.names[k];
      byId("labels").append(span);
      labels.push(span);
    }
  }
  function placeLabels(k, w) {
    const v = new THREE.Vector3(), width = stage.clientWidth, height = stage.clientHeight;
    labels.forEach((label, i) => {
      v.set(...place(i, k, w, here)).project(three.camera);
      const hidden = v.z > 1 || Math.abs(v.x) > 1.1 || Math.abs(v.y) > 1.1;
      label.hidden = hidden;
      if (!hidden) label.style.transform = `translate(${((v.x + 1) / 2) * width + 9}px, ${((1 - v.y) / 2) * height - 20}px)`;
    });
  }

  // ---- the chart
  const chart = byId("chart"), NS = "http://www.w3.org/2000/svg";
  const box = { left: 46, right: 8, top: 8, bottom: 22, width: 300, height: 200, low: -1, high: 1 };
  const chosen = new Set(curves.map((_, i) => i).sort((a, b) => largest(b) - largest(a)).slice(0, 8));
  let cursor = null;
  function largest(i) { return curves[i].values.reduce((m, x) => Math.max(m, Math.abs(x)), 0); }
  function element(name, attributes, text) {
    const node = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    chart.append(node);
    return node;
  }
  const along = (time) => box.left + ((box.width - box.left - box.right) * (time - start)) / (span || 1);
  const upwards = (value) => box.top + ((box.height - box.top - box.bottom) * (box.high - value)) / (box.high - box.low);
  function ticks(low, high, count) {
    const raw = (high - low) / count, ten = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].find((x) => x * ten >= raw) * ten, found = [];
    for (let x = Math.ceil(low / step) * step; x <= high + step * 1e-9; x += step) found.push(Math.abs(x) < step * 1e-9 ? 0 : x);
    return found;
  }
  const tick = (x) => String(Number(x.toPrecision(6))).replace("-", "−").replace("e+", "e");
  function drawChart() {
    if (!curves.length) return;
    chart.replaceChildren();
    box.width = Math.max(chart.clientWidth, 200); box.height = Math.max(chart.clientHeight, 120);
    chart.setAttribute("viewBox", `0 0 ${box.width} ${box.height}`);
    let low = 0, high = 0;
    for (const i of chosen) for (const x of curves[i].values) if (Number.isFinite(x)) { low = Math.min(low, x); high = Math.max(high, x); }
    if (low === high) high = low + 1;
    const pad = 0.05 * (high - low);
    box.low = low - (low < 0 ? pad : 0); box.high = high + (high > 0 ? pad : 0);
    const marks = ticks(box.low, box.high, Math.max(2, box.height / 45));
    box.left = 12 + 6.4 * Math.max(...marks.map((x) => tick(x).length), 3);
    for (const x of marks) {
      element("line", { class: "axis", x1: box.left, x2: box.width - box.right, y1: upwards(x), y2: upwards(x) });
      element("text", { x: box.left - 5, y: upwards(x) + 4, "text-anchor": "end" }, tick(x));
    }
    if (span > 0) {
      for (const x of ticks(scene.start, scene.start + end, Math.max(2, box.width / 80))) {
        element("text", { x: along(x - scene.start), y: box.height - 6, "text-anchor": "middle" }, tick(x));
      }
    }
    for (const i of chosen) {
      let path = "", pen = "M";
      curves[i].values.forEach((x, k) => {
        if (!Number.isFinite(x)) { pen = "M"; return; }
        path += `${pen}${along(t[k]).toFixed(1)} ${upwards(x).toFixed(1)}`; pen = "L";
      });
      element("path", { class: "curve", d: path, stroke: tint(i) });
    }
    cursor = element("line", { class: "cursor", y1: box.top, y2: box.height - box.bottom });
    moveCursor();
  }
  const order = new Map([...chosen].sort((a, b) => a - b).map((i, k) => [i, k]));
  const tint = (i) => PALETTES[scheme()][(order.get(i) ?? i) % PALETTES.light.length];
  function moveCursor() {
    if (!cursor) return;
    const x = along(Math.min(end, Math.max(start, state.time)));
    cursor.setAttribute("x1", x); cursor.setAttribute("x2", x);
  }
  function legend() {
    const first = [...curves.keys()].sort((a, b) => chosen.has(b) - chosen.has(a) || a - b);
    first.forEach((i) => {
      const one = curves[i];
      const button = document.createElement("button"), bar = document.createElement("i"), text = document.createElement("span");
      button.type = "button"; button.setAttribute("aria-pressed", chosen.has(i)); button.title = one.name;
      bar.style.background = tint(i);
      one.bar = bar; one.number = i;
      button.append(bar, text);
      one.text = text;
      text.textContent = one.name;
      button.addEventListener("click", () => {
        if (chosen.has(i)) chosen.delete(i); else chosen.add(i);
        button.setAttribute("aria-pressed", chosen.has(i));
        drawChart();
      });
      byId("legend").append(button);
    });
  }
  function readings(k, w) {
    curves.forEach((one, i) => {
      if (!chosen.has(i)) { if (one.text.textContent !== one.name) one.text.textContent = one.name; return; }
      const value = one.values[k] + w * (one.values[Math.min(k + 1, T - 1)] - one.values[k]);
      one.text.textContent = `${one.name} = ${shown(value)}`;
    });
  }

  // ---- time
  const slider = byId("time"), clock = byId("clock");
  function seek(time) {
    state.time = Math.min(end, Math.max(start, time));
    state.dirty = true;
  }
  function play(on) {
    if (on && state.time >= end && state.mode < 0) state.time = start;
    state.playing = on && span > 0;
    byId("play").textContent = state.playing ? "❚❚" : "▶";
    byId("play").setAttribute("aria-label", state.playing ? "pause" : "play");
    state.last = undefined;
  }
  function step(frames) {
    play(false);
    const [k, w] = instant(state.time);
    const there = Math.min(T - 1, Math.max(0, Math.round(k + w) + frames));
    seek(t[there]);
  }

  function draw() {
    const [k, w] = instant(state.time);
    slider.value = span ? (state.time - start) / span : 0;
    slider.setAttribute("aria-valuetext", `t = ${shown(scene.start + state.time)}`);
    clock.textContent = state.mode >= 0 ? "" : `t = ${shown(scene.start + state.time)}${scene.units[0] ? " " + scene.units[0] : ""}`;
    moveCursor(); readings(k, w);
    if (three) {
      update(k, w);
      three.renderer.render(three.world, three.camera);
      if (!byId("labels").hidden) placeLabels(k, w);
      scaleBar();
    }
    state.drawn = [k, w];
  }
  function frame(now) {
    if (state.playing) {
      if (state.last !== undefined) {
        state.time += ((now - state.last) / 1000) * state.speed * state.rate;
        if (state.time >= end) {
          if (state.mode >= 0 || byId("loop").checked) state.time = start + ((state.time - start) % span);
          else { state.time = end; play(false); }
        }
      }
      state.last = now;
      state.dirty = true;
    }
    if (state.dirty) { state.dirty = false; draw(); }
    requestAnimationFrame(frame);
  }

  // ---- the bar of a force of a round size
  function scaleBar() {
    if (!scene.scale) return;
    const { camera, controls } = three, distance = camera.position.distanceTo(controls.target);
    const pixels = stage.clientHeight / (2 * Math.tan((camera.fov * Math.PI) / 360) * distance); // of a unit of length
    const raw = 70 / (scene.scale * pixels), ten = 10 ** Math.floor(Math.log10(raw));
    const size = ([5, 2, 1].find((x) => x * ten <= raw) || 1) * ten;
    for (const kind of ["R", "F"]) {
      const row = byId(`scale-${kind}`);
      row.hidden = !forces[kind].length || !byId(`show-${kind}`).checked;
      row.firstElementChild.style.width = `${size * scene.scale * pixels}px`;
      row.lastElementChild.textContent = `${kind}: ${tick(size)}${scene.units[1] ? " " + scene.units[1] : ""}`;
    }
  }

  // ---- light and dark
  function paint() {
    if (!three) return;
    const { parts, world, renderer } = three;
    renderer.setClearColor(new THREE.Color(style("--back")), 1);
    const soft = new THREE.Color(style("--soft")), line = new THREE.Color(dark.matches ? "#b8c4d0" : "#6c7885");
    for (const mesh of [parts.rods.mesh, parts.anchors.mesh, parts.soft.mesh]) mesh.material.color.copy(mesh === parts.soft.mesh ? soft : line);
    for (const one of parts.surfaces) { one.face.color.set(dark.matches ? "#8fb8de" : "#6f9fcf"); one.edge.color.copy(soft); }
    for (const kind of ["R", "F"]) for (const mesh of [parts[kind].shafts, parts[kind].heads]) mesh.material.color.set(style(`--${kind}`));
    const tint = new THREE.Color();
    for (let k = 0; k < N; k++) parts.balls.setColorAt(k, tint.set(colour(k, N)));
    if (N) parts.balls.instanceColor.needsUpdate = true;
    if (parts.trails) {
      const { moving, tints } = parts.trails;
      const all = moving.map((k) => new THREE.Color(colour(k, N)));
      for (const buffer of tints) {
        for (let i = 0; i < buffer.count; i++) all[(i >> 1) % all.length].toArray(buffer.array, 3 * i);
        buffer.needsUpdate = true;
      }
    }
    state.dirty = true;
  }

  function repaint() {
    paint();
    for (const one of curves) one.bar.style.background = tint(one.number);
    drawChart();
  }
  function resize() {
    drawChart();
    if (!three) return;
    const width = stage.clientWidth || 1, height = stage.clientHeight || 1;
    three.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    three.renderer.setSize(width, height, false);
    three.camera.aspect = width / height;
    three.camera.updateProjectionMatrix();
    if (!state.touched) lookAtAll();
    state.dirty = true;
  }

  // ---- controls
  function connect() {
    byId("play").addEventListener("click", () => play(!state.playing));
    slider.addEventListener("input", () => { play(false); seek(start + Number(slider.value) * span); });
    byId("speed").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
    byId("reset").addEventListener("click", () => { state.touched = false; if (three) { three.controls.reset(); lookAtAll(); } });
    for (const kind of ["R", "F"]) {
      const box = byId(`show-${kind}`);
      box.parentElement.hidden = !forces[kind].length;
      box.checked = kind === "R" || N <= MANY_ARROWS;
      box.addEventListener("change", arrows);
    }
    byId("show-trails").parentElement.hidden = !(three && three.parts.trails) || state.mode >= 0;
    byId("show-surfaces").parentElement.hidden = !scene.surfaces.length;
    byId("show-trails").checked = Boolean(three && three.parts.trails && three.parts.trails.mesh.visible);
    byId("show-names").checked = N <= 8;
    for (const id of ["show-trails", "show-names", "show-surfaces"]) byId(id).addEventListener("change", arrows);
    byId("length").addEventListener("change", () => { state.dirty = true; });
    byId("length").hidden = byId("show-trails").parentElement.hidden;
    canvas.addEventListener("pointerdown", () => { state.touched = true; });
    canvas.addEventListener("wheel", () => { state.touched = true; }, { passive: true });
    const toTime = (event) => {
      const area = chart.getBoundingClientRect();
      const x = ((event.clientX - area.left) / area.width) * box.width;
      play(false);
      seek(start + (span * (x - box.left)) / (box.width - box.left - box.right));
    };
    chart.addEventListener("pointerdown", (event) => { chart.setPointerCapture(event.pointerId); toTime(event); });
    chart.addEventListener("pointermove", (event) => { if (event.buttons) toTime(event); });
    document.addEventListener("keydown", key);
    addEventListener("resize", resize);
    new ResizeObserver(resize).observe(stage);
    dark.addEventListener("change", repaint);
    still.addEventListener("change", () => { if (still.matches) play(false); });
    addEventListener("beforeprint", () => { // on paper everything is light
      state.printing = true;
      repaint();
      if (!three) return;
      draw();
      byId("instant").textContent = byId("clock").textContent;
      byId("still").src = canvas.toDataURL("image/png");
    });
    addEventListener("afterprint", () => { state.printing = false; repaint(); });
  }
  function arrows() {
    if (three) {
      const { parts } = three;
      for (const kind of ["R", "F"]) parts[kind].shafts.visible = parts[kind].heads.visible = byId(`show-${kind}`).checked;
      if (parts.trails) parts.trails.mesh.visible = byId("show-trails").checked;
      for (const one of parts.surfaces) one.group.visible = byId("show-surfaces").checked;
    }
    byId("labels").hidden = !byId("show-names").checked;
    state.dirty = true;
  }
  function key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const inField = event.target instanceof HTMLSelectElement || event.target instanceof HTMLButtonElement || (event.target instanceof HTMLInputElement && event.target.type === "checkbox");
    const speeds = [...byId("speed").options], at = byId("speed").selectedIndex;
    const choose = (i) => { byId("speed").selectedIndex = Math.min(speeds.length - 1, Math.max(0, i)); state.speed = Number(byId("speed").value); };
    const keys = {
      " ": () => play(!state.playing),
      ArrowLeft: () => step(event.shiftKey ? -10 : -1), ArrowRight: () => step(event.shiftKey ? 10 : 1),
      Home: () => { play(false); seek(start); }, End: () => { play(false); seek(end); },
      "+": () => choose(at + 1), "-": () => choose(at - 1),
      "0": () => byId("reset").click(),
    };
    if (!(event.key in keys) || (inField && [" ", "ArrowLeft", "ArrowRight", "Home", "End"].includes(event.key))) return;
    event.preventDefault();
    keys[event.key]();
  }

  function modes() {
    const select = byId("modes");
    select.hidden = !scene.modes.length;
    scene.modes.forEach((mode, i) => {
      const option = document.createElement("option");
      option.value = i; option.textContent = mode.name;
      select.append(option);
    });
    if (state.mode >= 0) select.value = state.mode;
    const tell = () => { byId("about").textContent = state.mode >= 0 ? scene.modes[state.mode].note : ""; };
    select.addEventListener("change", () => { state.mode = Number(select.value); tell(); state.dirty = true; });
    tell();
  }

  byId("head").hidden = !curves.length && !scene.modes.length;
  document.body.classList.toggle("wide", !curves.length && !scene.modes.length && !scene.notes.length);
  byId("curves").hidden = !curves.length;
  byId("chart").toggleAttribute("hidden", !curves.length);
  byId("head").textContent = scene.modes.length ? "Modes" : "Multipliers λ over t";
  for (const note of scene.notes) {
    const item = document.createElement("li");
    item.textContent = note;
    byId("notes").append(item);
  }
  // A run is shown in its own time if that is watchable, else within ten seconds.
  state.rate = scene.rate;
  if (scene.rate !== 1 && state.mode < 0) {
    const usual = [...byId("speed").options].find((one) => one.value === "1");
    usual.textContent = `1× (1 s shows ${tick(Number(scene.rate.toPrecision(3)))}${scene.units[0] ? " " + scene.units[0] : ""})`;
  }
  legend(); modes(); connect(); paint(); resize(); arrows();
  byId("loop").checked = true;
  seek(start); draw();
  play(!still.matches);
  requestAnimationFrame(frame);

  // For tests: what stands on the screen, read back from the meshes.
  window.animation = {
    ready: true, firstFrame: performance.now(), webgl: Boolean(three), frames: T, times: Float64Array.from(t, (x) => scene.start + x), play,
    seek: (time) => { play(false); seek(time - scene.start); draw(); },
    time: () => scene.start + state.time, playing: () => state.playing, size: scene.size,
    force: (kind, k) => {
      const matrix = new THREE.Matrix4(), at = new THREE.Vector3(), turn = new THREE.Quaternion(), size = new THREE.Vector3();
      let length = 0;
      for (const mesh of [three.parts[kind].shafts, three.parts[kind].heads]) {
        mesh.getMatrixAt(k, matrix); matrix.decompose(at, turn, size); length += size.y;
      }
      return length / scene.scale;
    },
    place: (k) => {
      const matrix = new THREE.Matrix4();
      three.parts.balls.getMatrixAt(k, matrix);
      return [12, 13, 14].map((i, axis) => matrix.elements[i] * scene.size + scene.centre[axis]);
    },
    line: (i) => { // the ends of the pieces of a line or a net
      const all = three.parts.surfaces[i].group.children.find((one) => one.isLineSegments).geometry.attributes.position.array;
      return Array.from(all, (x, axis) => x * scene.size + scene.centre[axis % 3]);
    },
    choose: (i) => { byId("modes").value = i; byId("modes").dispatchEvent(new Event("change")); draw(); },
  };
})();
