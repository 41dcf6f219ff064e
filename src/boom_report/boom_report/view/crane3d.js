"use strict";
// The crane in 3D: one group of parts for the machine, one, translucent, for the model. Lengths in m; x outward, y up, z across.
(function () {
  const DEPTH = 0.26;

  const bar = (length, height, depth, material) => new THREE.Mesh(new THREE.BoxGeometry(length, height, depth), material);
  function box(length, height, depth, material) {
    const mesh = bar(length, height, depth, material);
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry), material.userData.edge);
    mesh.add(edges);
    return mesh;
  }

  // Lays a part of unit length between two points (x, y).
  function lay(part, a, b) {
    part.position.set((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, part.position.z);
    part.rotation.z = Math.atan2(b[1] - a[1], b[0] - a[0]);
    part.scale.x = Math.max(1e-3, Math.hypot(b[0] - a[0], b[1] - a[1]));
  }

  function rod(radius, material) {
    const geometry = new THREE.CylinderGeometry(radius, radius, 1, 20);
    geometry.rotateZ(Math.PI / 2);
    return new THREE.Mesh(geometry, material);
  }

  function pin(material, radius) {
    const geometry = new THREE.CylinderGeometry(radius, radius, DEPTH + 0.1, 20);
    geometry.rotateX(Math.PI / 2);
    return new THREE.Mesh(geometry, material);
  }

  function materials(ghost, colours) {
    const make = (colour, opacity) => {
      const m = new THREE.MeshLambertMaterial({ color: colour, transparent: ghost, opacity: ghost ? opacity : 1, depthWrite: !ghost });
      m.userData.edge = new THREE.LineBasicMaterial({ color: ghost ? colours.ghost : colours.edge, transparent: true, opacity: ghost ? 0.8 : 0.45 });
      return m;
    };
    if (ghost) { const one = make(colours.ghost, 0.3); return { boom: one, steel: one, frame: one, load: one, cylinder: one, one }; }
    return { boom: make(colours.boom), steel: make("#c3cad1"), frame: make("#5b6570"), load: make("#8d6a43"), cylinder: make("#5b6570") };
  }

  // Interpolates the positions of the linkage's pins at an angle.
  function at(angles, rows, angle) {
    const last = angles.length - 1, x = ((angle - angles[0]) / (angles[last] - angles[0])) * last;
    const k = Math.max(0, Math.min(last - 1, Math.floor(x))), f = Math.max(0, Math.min(1, x - k));
    const a = rows[k], b = rows[k + 1];
    return Array.isArray(a) ? a.map((v, i) => v + f * (b[i] - v)) : a + f * (b - a);
  }

  // What does not move within itself as one mesh with one set of edges: a frame costs by the number of draws.
  function fused(parts, ghost) {
    const look = new THREE.MeshLambertMaterial({ vertexColors: true, transparent: ghost, opacity: ghost ? 0.3 : 1, depthWrite: !ghost });
    const attribute = (list) => {
      const all = new Float32Array(list.reduce((n, a) => n + a.length, 0));
      list.reduce((n, a) => { all.set(a, n); return n + a.length; }, 0);
      return new THREE.BufferAttribute(all, 3);
    };
    const of = (geometries, name) => attribute(geometries.map((g) => g.attributes[name].array));
    const placed = (geometry, part) => { part.updateMatrix(); return geometry.applyMatrix4(part.matrix); };
    const solids = parts.map((part) => placed(part.geometry.toNonIndexed(), part)), solid = new THREE.BufferGeometry();
    solid.setAttribute("position", of(solids, "position"));
    solid.setAttribute("normal", of(solids, "normal"));
    const tint = (part, k) => { const c = part.material.color; return solids[k].attributes.position.array.map((_, i) => [c.r, c.g, c.b][i % 3]); };
    solid.setAttribute("color", attribute(parts.map(tint)));
    const mesh = new THREE.Mesh(solid, look), edged = parts.filter((part) => part.children.length);
    if (edged.length) {
      const lines = new THREE.BufferGeometry();
      lines.setAttribute("position", of(edged.map((part) => placed(part.children[0].geometry, part)), "position"));
      mesh.add(new THREE.LineSegments(lines, edged[0].children[0].material));
    }
    return mesh;
  }

  function crane(scene, ghost, colours) {
    const all = new THREE.Group(), look = materials(ghost, colours), height = scene.joint[1];
    const column = box(0.42, height, 0.4, look.frame);
    column.position.y = -height / 2;
    const base = box(2.4, 0.14, 1.7, look.frame);
    base.position.set(-0.3, -height - 0.07, 0);
    const [, elbow, tip] = scene.boom, size = Math.hypot(tip[0], tip[1]);
    const inner = box(1, 0.3, DEPTH, look.boom), outer = box(1, 0.24, DEPTH * 0.8, look.steel);
    lay(inner, [0, 0], elbow);
    lay(outer, elbow, tip);
    const pins = [[0, 0], elbow, tip].map((p) => { const m = pin(look.frame, 0.09); m.position.set(p[0], p[1], 0); return m; });
    const boom = fused([inner, outer, ...pins], ghost);
    all.add(fused([column, base], ghost), boom);
    const links = scene.bars.map((_, k) => {
      const part = k ? bar(1, 0.1, 0.08, look.steel) : rod(0.075, look.steel);
      part.position.z = k ? (k % 2 ? 0.2 : -0.2) : 0;
      all.add(part);
      return part;
    });
    const barrel = rod(0.11, look.cylinder);
    if (links.length) all.add(barrel);
    const hook = rod(0.025, look.frame), load = rod(scene.load > 0 ? Math.min(0.6, 0.12 + 0.02 * Math.cbrt(scene.load)) : 0.06, look.load);
    lay(hook, [0, 0], [0, -0.9]);
    load.rotation.set(0, Math.PI / 2, 0);
    load.scale.x = scene.load > 0 ? 3 : 0.4;
    load.position.y = -0.95;
    const hanging = fused([hook, load], ghost);
    all.add(hanging);
    function pose(angle) {
      boom.rotation.z = angle;
      links.forEach((part, k) => {
        const p = at(scene.angles, scene.bars[k], angle);
        lay(part, [p[0], p[1]], [p[2], p[3]]);
        if (!k) {  // the barrel has a length of its own, the rod comes out of it
          const first = scene.bars[0][0], barrelLength = Math.hypot(first[2] - first[0], first[3] - first[1]) * 0.86;
          const long = Math.hypot(p[2] - p[0], p[3] - p[1]), share = Math.min(1, barrelLength / long);
          lay(barrel, [p[0], p[1]], [p[0] + share * (p[2] - p[0]), p[1] + share * (p[3] - p[1])]);
        }
      });
      const c = Math.cos(angle), s = Math.sin(angle), x = tip[0] * c - tip[1] * s, y = tip[0] * s + tip[1] * c;
      hanging.position.set(x, y, 0);
      return [x, y];
    }
    return { all, pose, size, materials: Object.values(look) };
  }

  // Smooth edges cost a third of the time where a processor draws in the place of a graphics card (remote desktops, containers).
  function drawnByProcessor() {
    const gl = document.createElement("canvas").getContext("webgl2"), info = gl && gl.getExtension("WEBGL_debug_renderer_info");
    const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
    if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software|basic render/i.test(name);
  }

  // Draws on a canvas. The returned object: set(scene), show(angle, ghostAngle, mode, apart), paint().
  window.makeCrane3d = function (canvas) {
    let renderer;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawnByProcessor(), alpha: true, powerPreference: "low-power" });
    } catch (_) { return null; }
    const style = () => {
      const css = getComputedStyle(canvas), v = (name) => css.getPropertyValue(name).trim();
      return { boom: v("--machine"), ghost: v("--model"), edge: v("--edge"), grid: v("--grid"), apart: v("--apart") };
    };
    const world = new THREE.Scene(), camera = new THREE.PerspectiveCamera(32, 1, 0.1, 200);
    const controls = new THREE.OrbitControls(camera, canvas);
    const sun = new THREE.DirectionalLight("#ffffff", 2.6);
    sun.position.set(3, 8, 9);
    world.add(new THREE.HemisphereLight("#ffffff", "#b9bec4", 2.2), sun);
    let machine, ghost, marker, ground, dirty = true, scene = null, seen = null;
    controls.addEventListener("change", () => { dirty = true; });

    function dispose(group) {
      if (!group) return;
      world.remove(group);
      group.traverse((o) => { if (o.geometry) o.geometry.dispose(); });
    }
    function set(given) {
      scene = given;
      seen = null;
      [machine && machine.all, ghost && ghost.all, marker, ground].forEach(dispose);
      const colours = style();
      machine = crane(scene, false, colours);
      ghost = crane(scene, true, colours);
      marker = new THREE.Mesh(new THREE.RingGeometry(0.28, 0.36, 40), new THREE.MeshBasicMaterial({ color: colours.apart, side: 2, depthTest: false }));
      marker.renderOrder = 2;
      ground = new THREE.GridHelper(24, 24, colours.grid, colours.grid);  // 1 m
      ground.rotation.x = Math.PI / 2;
      ground.position.set(3, 0, -4);
      world.add(machine.all, ghost.all, marker, ground);
      home();
    }
    function home() {
      if (!scene) return;
      const reach = Math.max(4, machine.size), narrow = camera.aspect < 1.2 ? 1.2 / camera.aspect : 1;
      controls.target.set(reach * 0.42, -reach * 0.16, -0.8);
      camera.position.set(reach * 1.7, reach * 0.5, reach * 2.3 * narrow);
      controls.update();
      dirty = true;
    }
    // Whether the picture changes: a tip that moves by less than a quarter of a pixel is where it was.
    function moved(next) {
      const metre = canvas.clientHeight / (2 * Math.tan((camera.fov * Math.PI) / 360) * camera.position.distanceTo(controls.target));
      const far = (a, b) => (a === null || b === null ? a !== b : Math.abs(a - b) * machine.size * metre > 0.25);
      return !seen || next.mode !== seen.mode || next.parted !== seen.parted || far(next.angle, seen.angle) || far(next.ghost, seen.ghost);
    }
    function show(angle, ghostAngle, mode, parted) {
      if (!scene || angle === null) return;
      const next = { angle, ghost: ghostAngle, mode, parted: !!parted };
      if (!moved(next)) return;
      seen = next;
      const tip = machine.pose(angle), known = ghostAngle !== null && mode !== "off";
      ghost.all.visible = known;
      if (known) ghost.pose(ghostAngle);
      marker.visible = next.parted;
      marker.position.set(tip[0], tip[1], 0.2);
      ghost.all.position.z = mode === "beside" ? -3 : 0;
      dirty = true;
    }
    function paint() {
      const width = canvas.clientWidth, height = canvas.clientHeight, ratio = Math.min(window.devicePixelRatio || 1, 2);
      if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
        renderer.setPixelRatio(ratio);
        renderer.setSize(width, height, false);
        camera.aspect = width / Math.max(1, height);
        camera.updateProjectionMatrix();
        home();
        dirty = true;
      }
      if (!dirty || !width) return;
      dirty = false;
      if (marker && marker.visible) marker.quaternion.copy(camera.quaternion);
      renderer.render(world, camera);
    }
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (scene) set(scene); });
    return { set, show, paint, home };
  };
  window.interpolatedPin = at;
})();
