// Validates a bill of materials against the schema of CycloneDX 1.4, strictly:  node validate.mjs FILE
import { Spec, Validation } from "@cyclonedx/cyclonedx-library";
import { readFileSync } from "node:fs";

const problem = await new Validation.JsonStrictValidator(Spec.Version.v1dot4).validate(readFileSync(process.argv[2], "utf8"));
if (problem !== null) {
  console.log(JSON.stringify(problem));
  process.exit(1);
}
