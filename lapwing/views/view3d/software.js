// Simplified images for a software renderer, without a graphics processor.
(() => {
  const probe = document.createElement("canvas").getContext("webgl2");
  const device = probe?.getExtension("WEBGL_debug_renderer_info");
  const slow = /swiftshader|llvmpipe|softpipe|basic render/i.test(device ? probe.getParameter(device.UNMASKED_RENDERER_WEBGL) : "");
  const smooth = location.hash === "#smooth"; // set for images, which need not be drawn in real time
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  const CHEAP = { alpha: false, preserveDrawingBuffer: false }; // no blending with the page, no copy of each image
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return context.call(this, kind, slow && kind === "webgl2" ? { ...options, ...CHEAP, antialias: smooth } : options);
  };

  const ROWS = 32; // strips of the sky
  function flattenSky(scene) { // draws the background first as strips of interpolated colours, without texture and depth
    scene.traverse((object) => {
      const { geometry, material } = object, image = material?.uniforms?.colorMap?.value?.image;
      if (!image?.width) return;
      const drawing = Object.assign(document.createElement("canvas"), { width: 1, height: image.height }).getContext("2d");
      drawing.drawImage(image, 0, 0);
      const { data } = drawing.getImageData(0, 0, 1, image.height), { width, height } = geometry.parameters;
      const strips = new geometry.constructor(width, height, 1, ROWS), { uv } = strips.attributes;
      const tints = Array.from({ length: uv.count }, (_, k) => {
        const row = Math.round((1 - uv.getY(k)) * (image.height - 1));
        return [...data.slice(4 * row, 4 * row + 3)].map((value) => value / 255);
      });
      strips.setAttribute("tint", new uv.constructor(tints.flat(), 3));
      object.geometry = strips;
      material.vertexShader = "attribute vec3 tint; varying vec3 vTint; void main() { vTint = tint; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }";
      material.fragmentShader = "varying vec3 vTint; void main() { gl_FragColor = vec4(vTint, 1.0); }";
      Object.assign(material, { depthTest: false, depthWrite: false, needsUpdate: true });
      object.renderOrder = -1;
    });
  }

  function onScreen({ r, g, b }) { // ACES tone mapping of three.js
    const fit = (v) => (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
    const x = fit((0.59719 * r + 0.35458 * g + 0.04823 * b) / 0.6);
    const y = fit((0.076 * r + 0.90834 * g + 0.01566 * b) / 0.6);
    const z = fit((0.0284 * r + 0.13383 * g + 0.83777 * b) / 0.6);
    return [1.60475 * x - 0.53108 * y - 0.07367 * z, 1.10813 * y - 0.10208 * x - 0.00605 * z, 1.07602 * z - 0.00327 * x - 0.07276 * y];
  }

  function lightenGround(scene) { // converts three colours once, not those of every pixel
    scene.traverse(({ material }) => {
      const { cellColor, sectionColor, planeColor, shadowOpacity } = material?.uniforms ?? {};
      if (!shadowOpacity || !material.toneMapped) return;
      for (const { value } of [cellColor, sectionColor]) value.setRGB(...onScreen(value));
      for (const { value } of [cellColor, sectionColor, planeColor]) value.convertLinearToSRGB();
      shadowOpacity.value = 1 - (1 - shadowOpacity.value) ** (1 / 2.2);
      const fragmentShader = material.fragmentShader.replace("#include <colorspace_fragment>", "").replace("pow(d, fadeStrength)", "d");
      Object.assign(material, { fragmentShader, toneMapped: false, needsUpdate: true });
    });
  }

  let turns = 0; // calls of `simplify`
  function simplify(now, at, filming) { // uses one small shadow around the selected vehicle instead of three
    now.gl.shadowMap.needsUpdate ||= filming || ++turns % 2 === 0; // at the rate of a recording
    const lights = now.scene.children.filter((child) => child.isDirectionalLight && child.castShadow);
    if (!lights.length) return;
    const [light, ...others] = lights, half = 3 * window.lapwing.size, height = 200;
    for (const other of others) {
      light.intensity += other.intensity;
      other.castShadow = other.visible = false;
      other.intensity = 0;
    }
    const fresh = !light.shadow.around;
    light.shadow.around = at.place;
    const edge = now.viewport.dpr < devicePixelRatio ? 512 : 1024; // as coarse as the image during motion
    if (!smooth && light.shadow.mapSize.x !== edge) {
      light.shadow.mapSize.set(edge, edge);
      light.shadow.map?.dispose();
      light.shadow.map = null;
      now.gl.shadowMap.needsUpdate = true;
      now.invalidate();
    }
    if (fresh) {
      if (!smooth) {
        now.gl.shadowMap.type = 0; // a hard edge
        now.gl.shadowMap.autoUpdate = false;
        flattenSky(now.scene);
        lightenGround(now.scene);
      }
      const update = light.shadow.updateMatrices; // called by three.js before it draws the shadow map
      light.shadow.updateMatrices = function (source) {
        const [x, y, z] = this.around, { camera } = this, toward = camera.position.clone();
        toward.set(0.2, 1, 0.2).normalize().multiplyScalar(0.5 * height);
        source.matrixWorld.makeTranslation(x - toward.x, y + toward.y, z - toward.z);
        source.target.matrixWorld.makeTranslation(x, y, z);
        Object.assign(camera, { left: -half, right: half, bottom: -half, top: half, near: 0.1, far: height });
        camera.updateProjectionMatrix();
        update.call(this, source);
      };
    }
  }

  window.lapwingSoftware = { slow, smooth, simplify };
})();
