// Adds skies and conditions to the module.
#pragma once

#include <nanobind/nanobind.h>

void bind_condition(nanobind::module_& m);
