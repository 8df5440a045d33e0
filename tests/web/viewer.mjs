// Babylon.js, the viewer that implements EXT_lights_image_based, in a page of its own: loads a GLB and says
// what a sphere shows when it is looked at from a given side. Numbers are read from a float target, before
// any tone curve.

import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

import { chromium } from "playwright-core";

const modules = fileURLToPath(new URL("node_modules", import.meta.url));

const page = `<!doctype html><meta charset="utf-8"><title>viewer</title><link rel="icon" href="data:,">
<script type="importmap">{"imports": {"@babylonjs/": "/modules/@babylonjs/"}}</script>
<canvas id="canvas" width="512" height="512"></canvas>
<script type="module">
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { RenderTargetTexture } from "@babylonjs/core/Materials/Textures/renderTargetTexture.js";
import { PBRMaterial } from "@babylonjs/core/Materials/PBR/pbrMaterial.js";
import { Color3, Color4 } from "@babylonjs/core/Maths/math.color.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { CreateSphere } from "@babylonjs/core/Meshes/Builders/sphereBuilder.js";
import { AppendSceneAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import { Scene } from "@babylonjs/core/scene.js";
import "@babylonjs/core/Engines/Extensions/engine.rawTexture.js";
import "@babylonjs/core/Loading/loadingScreen.js";
import "@babylonjs/core/Helpers/sceneHelpers.js";
import "@babylonjs/core/Materials/Textures/Loaders/envTextureLoader.js";
import "@babylonjs/core/Materials/Textures/baseTexture.polynomial.js";
import "@babylonjs/loaders/glTF/2.0/index.js";

const canvas = document.getElementById("canvas");
const engine = new Engine(canvas, false, { preserveDrawingBuffer: true });
const kSide = 9;  // pixels of the target that numbers are read from

window.load = async (base64, { rightHanded, gammaSpace }) => {
  window.scene?.dispose();
  window.sky = undefined;
  const scene = (window.scene = new Scene(engine));
  scene.useRightHandedSystem = rightHanded;
  await AppendSceneAsync("data:model/gltf-binary;base64," + base64, scene, { pluginExtension: ".glb" });
  const camera = (window.camera = new FreeCamera("camera", new Vector3(0, 0, -5), scene));
  camera.fov = 0.002;  // a patch so small that the sphere's normal hardly turns
  camera.minZ = 0.1;
  scene.activeCamera = camera;
  scene.imageProcessingConfiguration.applyByPostProcess = true;  // leaves colours linear
  const material = (window.material = new PBRMaterial("material", scene));
  material.brdf.mixIblRadianceWithIrradiance = false;  // a look of its own, not the light's
  window.sphere = CreateSphere("sphere", { diameter: 2, segments: 64 }, scene);
  window.sphere.material = material;
  const texture = scene.environmentTexture;
  // Release 9.28 unpacks RGBD to linear half floats and leaves the texture marked as gamma-encoded, so that
  // materials would raise it to the power 2.2 once more.
  texture.gammaSpace = gammaSpace;
  return { name: texture?.name, size: texture?.getSize().width, level: texture?.level };
};

// What the sphere shows at its middle, looked at from the glTF node of each name.
window.look = async (names, { metallic, roughness }) => {
  const { scene, camera, material } = window;
  material.metallic = metallic;
  material.roughness = roughness;
  material.albedoColor = Color3.White();
  material.metallicF0Factor = metallic ? 1 : 0;
  const target = new RenderTargetTexture("target", kSide, scene, { generateMipMaps: false, type: 1 });
  target.clearColor = new Color4(9, 9, 9, 9);
  target.renderList = [window.sphere];
  target.activeCamera = camera;
  await scene.whenReadyAsync();
  for (let tries = 0; !target.isReadyForRendering() && tries < 500; tries += 1)
    await new Promise((resolve) => setTimeout(resolve, 20));
  const seen = [];
  for (const name of names) {
    const node = scene.getNodeByName(name);
    node.computeWorldMatrix(true);
    camera.position.copyFrom(node.getAbsolutePosition());
    camera.upVector = Math.abs(camera.position.y) > 4 ? new Vector3(0, 0, 1) : new Vector3(0, 1, 0);
    camera.setTarget(Vector3.Zero());
    scene.incrementRenderId();
    camera.getViewMatrix(true);
    scene.updateTransformMatrix(true);
    target.render();
    const pixels = await target.readPixels();
    const middle = 4 * ((kSide * kSide - 1) / 2);
    seen.push([pixels[middle], pixels[middle + 1], pixels[middle + 2]]);
  }
  target.dispose();
  return seen;
};

// The sphere and the sky behind it, for people.
window.picture = async (name, { metallic, roughness }) => {
  const { scene, camera, material } = window;
  material.metallic = metallic;
  material.roughness = roughness;
  camera.fov = 0.8;
  camera.position.copyFrom(scene.getNodeByName(name).getAbsolutePosition());
  camera.upVector = new Vector3(0, 1, 0);
  camera.setTarget(Vector3.Zero());
  scene.imageProcessingConfiguration.applyByPostProcess = false;
  window.sky ??= scene.createDefaultSkybox(scene.environmentTexture, true, 100, 0, false);
  await scene.whenReadyAsync();
  for (let frame = 0; frame < 10; frame += 1) {
    scene.render();
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  camera.fov = 0.002;
  scene.imageProcessingConfiguration.applyByPostProcess = true;
};
window.ready = true;
</script>`;

export async function startViewer() {
  const server = createServer((request, response) => {
    const path = new URL(request.url, "http://viewer").pathname;
    if (path === "/") return response.setHeader("Content-Type", "text/html").end(page);
    const file = normalize(join(modules, path.replace(/^\/modules\//, "")));
    if (!path.startsWith("/modules/@babylonjs/") || !file.startsWith(modules)) return response.writeHead(404).end();
    try {
      const body = readFileSync(file);
      response.setHeader("Content-Type", file.endsWith(".js") ? "text/javascript" : "application/octet-stream").end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--disable-background-networking", "--disable-component-update"],
  });
  const tab = await browser.newPage({ viewport: { width: 512, height: 512 } });
  const complaints = [];
  tab.on("pageerror", (error) => complaints.push(String(error)));
  tab.on("console", (message) => {
    if (message.type() === "error") complaints.push(`${message.text()} ${message.location().url}`);
  });
  await tab.goto(`http://127.0.0.1:${server.address().port}/`);
  await tab.waitForFunction(() => window.ready, null, { timeout: 120000 }).catch((error) => {
    throw new Error(`the viewer did not start: ${error}\n${complaints.join("\n")}`);
  });
  return {
    complaints,
    load: (glb, options = {}) =>
      tab.evaluate(([bytes, given]) => window.load(bytes, given), [Buffer.from(glb).toString("base64"), { rightHanded: false, gammaSpace: false, ...options }]),
    look: (names, material) => tab.evaluate(([n, m]) => window.look(n, m), [names, material]),
    picture: async (path, name, material) => {
      await tab.evaluate(([n, m]) => window.picture(n, m), [name, material]);
      await tab.locator("#canvas").screenshot({ path });
    },
    stop: async () => {
      await browser.close();
      server.close();
    },
  };
}

// A GLB's JSON, and the GLB with another JSON.
export function jsonOf(glb) {
  const length = new DataView(glb.buffer, glb.byteOffset).getUint32(12, true);
  return JSON.parse(new TextDecoder().decode(glb.subarray(20, 20 + length)));
}

export function withJson(glb, json) {
  const old = new DataView(glb.buffer, glb.byteOffset).getUint32(12, true);
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, 0x20)]);
  const head = Buffer.from(glb.subarray(0, 20));
  head.writeUInt32LE(20 + padded.length + (glb.length - 20 - old), 8);
  head.writeUInt32LE(padded.length, 12);
  return new Uint8Array(Buffer.concat([head, padded, Buffer.from(glb.subarray(20 + old))]));
}

// The asset with an empty node at five times each direction, named by its index: where glTF puts them, the
// viewer shall look from.
export function withPlaces(glb, directions) {
  const json = jsonOf(glb);
  json.nodes = directions.map((d, i) => ({ name: `place ${i}`, translation: d.map((x) => 5 * x) }));
  json.scenes[0].nodes = directions.map((_, i) => i);
  return withJson(glb, json);
}
