// Khronos validator on GLB files: node tests/web/validate.mjs FILE.glb ... ; exit code 1 when one has errors or warnings.
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import validator from 'gltf-validator';

let clean = true;
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { maxIssues: 0 });
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  const { drawCallCount, totalVertexCount, totalTriangleCount } = report.info;
  console.log(
    `${basename(path)}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos; ` +
      `${drawCallCount} meshes drawn, ${totalVertexCount} vertices, ${totalTriangleCount} triangles`,
  );
  for (const message of messages.slice(0, 20)) {
    console.log(`  ${['error', 'warning', 'info', 'hint'][message.severity]} ${message.code} ${message.pointer ?? ''}: ${message.message}`);
  }
  clean &&= numErrors + numWarnings === 0;
}
process.exit(clean ? 0 : 1);
