#include "service/release.hpp"

namespace railfix::service {

const char* release() {
  return RAILFIX_VERSION;
}

}  // namespace railfix::service
