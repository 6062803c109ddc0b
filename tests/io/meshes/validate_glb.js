// Prints "errors warnings infos hints" as the Khronos glTF validator counts them, then its messages.
// usage: NODE_PATH=<folder with gltf-validator> node validate_glb.js FILE
const fs = require('fs');
const validator = require('gltf-validator');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2]))).then((report) => {
  const n = report.issues;
  console.log(n.numErrors, n.numWarnings, n.numInfos, n.numHints);
  for (const m of n.messages) console.log(m.code, m.message, m.pointer);
});
