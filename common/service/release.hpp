// Which build this is. Compiled in one place, so that the same service can be linked as another build
// (tests/support/other_build).
#pragma once

namespace railfix::service {

const char* release();

}  // namespace railfix::service
