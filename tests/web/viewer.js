// A page that shows /rig.glb and lets a test pose it: window.rig.show({ camera, weights }) and window.rig.report().
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

// Supersampled instead of multisampled: software GL lets what is behind a surface shine through it in single pixels.
const renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
renderer.setPixelRatio(2);
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0x22242a);
scene.add(new THREE.HemisphereLight(0xdde4ff, 0x554a44, 1.1));
const key = new THREE.DirectionalLight(0xffffff, 2.4);
key.position.set(-0.4, 0.6, 0.9);
const rim = new THREE.DirectionalLight(0xffe9d6, 0.9);
rim.position.set(0.9, 0.2, 0.3);
scene.add(key, rim);
const camera = new THREE.PerspectiveCamera(24, innerWidth / innerHeight, 0.01, 10);

const cameras = {
  front: [[0, -0.03, 0.75], [0, -0.03, 0]],
  side: [[0.7, -0.03, 0.25], [0, -0.03, -0.05]],
  eyes: [[0, 0, 0.25], [0, 0, 0]],
  mouth: [[0.03, -0.06, 0.26], [0, -0.07, 0]],
};

const gltf = await new GLTFLoader().loadAsync('/rig.glb');
scene.add(gltf.scene);
const meshes = [];
gltf.scene.traverse((object) => object.isMesh && meshes.push(object));

window.rig = {
  show({ camera: name = 'front', weights = {} }) {
    for (const mesh of meshes) {
      const index = mesh.morphTargetDictionary ?? {};
      mesh.morphTargetInfluences?.fill(0);
      for (const [target, weight] of Object.entries(weights)) {
        if (target in index) mesh.morphTargetInfluences[index[target]] = weight;
      }
    }
    const [eye, at] = cameras[name];
    camera.position.set(...eye);
    camera.lookAt(...at);
    renderer.render(scene, camera);
  },
  report: () => ({
    bones: meshes[0].skeleton?.bones.map((bone) => bone.name) ?? [],
    meshes: meshes.map((mesh) => ({
      name: mesh.name,
      vertices: mesh.geometry.attributes.position.count,
      targets: Object.keys(mesh.morphTargetDictionary ?? {}),
      textured: Boolean(mesh.material.map),
      normalMap: Boolean(mesh.material.normalMap),
    })),
  }),
};
document.title = 'ready';
