// Adds the section tracer to the module.
#pragma once

#include <nanobind/nanobind.h>

void bind_section(nanobind::module_& m);
