#include "transom/build.h"

namespace transom {

const char* build_description() {
  return TRANSOM_VERSION ", " TRANSOM_BUILD;
}

}  // namespace transom
