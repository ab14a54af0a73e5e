#include "draft.hpp"

namespace railfix::tool {

Draft::~Draft() {
  std::error_code failed;
  if (!kept_) std::filesystem::remove(file_, failed);
}

}  // namespace railfix::tool
