#include "tests/support/gltf_builder.h"

namespace lightkiln::test {

MeshData make_quad(const Vec3& corner, const Vec3& u, const Vec3& v) {
  MeshData mesh;
  mesh.positions = {corner, corner + u, corner + u + v, corner + v};
  mesh.normals.assign(4, normalize(cross(u, v)));
  mesh.texcoords = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

MeshData make_floor(float half, float height) {
  return make_quad({-half, height, half}, {2 * half, 0, 0}, {0, 0, -2 * half});
}

MeshData make_box(const Vec3& lower, const Vec3& upper) {
  const Vec3 size = upper - lower;
  const Vec3 x{size.x, 0, 0}, y{0, size.y, 0}, z{0, 0, size.z};
  MeshData box = make_quad(lower + x, y, z);      // +X
  box = merged(box, make_quad(lower, z, y));      // -X
  box = merged(box, make_quad(lower + y, z, x));  // +Y
  box = merged(box, make_quad(lower, x, z));      // -Y
  box = merged(box, make_quad(lower + z, x, y));  // +Z
  return merged(box, make_quad(lower, y, x));     // -Z
}

MeshData make_sphere(const Vec3& centre, float radius, int rings, int segments) {
  MeshData mesh;
  const auto add = [&](double polar, double azimuth) {
    const Vec3 n = to_float({std::sin(polar) * std::sin(azimuth), std::cos(polar),
                             std::sin(polar) * std::cos(azimuth)});
    mesh.normals.push_back(n);
    mesh.positions.push_back(centre + n * radius);
    mesh.texcoords.push_back(
        {static_cast<float>(azimuth / (2 * kPi)), static_cast<float>(polar / kPi)});
    return static_cast<uint32_t>(mesh.positions.size() - 1);
  };
  const uint32_t top = add(0, 0);
  for (int ring = 1; ring < rings; ++ring) {
    for (int segment = 0; segment < segments; ++segment) {
      add(kPi * ring / rings, 2 * kPi * segment / segments);
    }
  }
  const uint32_t bottom = add(kPi, 0);
  const auto at = [&](int ring, int segment) {
    return static_cast<uint32_t>(1 + (ring - 1) * segments + segment % segments);
  };
  for (int segment = 0; segment < segments; ++segment) {
    mesh.triangles.push_back({top, at(1, segment), at(1, segment + 1)});
    for (int ring = 1; ring + 1 < rings; ++ring) {
      mesh.triangles.push_back(
          {at(ring, segment), at(ring + 1, segment), at(ring + 1, segment + 1)});
      mesh.triangles.push_back(
          {at(ring, segment), at(ring + 1, segment + 1), at(ring, segment + 1)});
    }
    mesh.triangles.push_back({bottom, at(rings - 1, segment + 1), at(rings - 1, segment)});
  }
  return mesh;
}

MeshData make_grid(float half, int divisions, float height) {
  MeshData mesh;
  const float step = 2 * half / static_cast<float>(divisions);
  for (int row = 0; row <= divisions; ++row) {
    for (int column = 0; column <= divisions; ++column) {
      mesh.positions.push_back({-half + step * static_cast<float>(column), height,
                                half - step * static_cast<float>(row)});
      mesh.normals.push_back({0, 1, 0});
      mesh.texcoords.push_back({static_cast<float>(column) / static_cast<float>(divisions),
                                static_cast<float>(row) / static_cast<float>(divisions)});
    }
  }
  const auto at = [&](int row, int column) {
    return static_cast<uint32_t>(row * (divisions + 1) + column);
  };
  for (int row = 0; row < divisions; ++row) {
    for (int column = 0; column < divisions; ++column) {
      mesh.triangles.push_back({at(row, column), at(row, column + 1), at(row + 1, column + 1)});
      mesh.triangles.push_back({at(row, column), at(row + 1, column + 1), at(row + 1, column)});
    }
  }
  return mesh;
}

template <typename T>
static void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

MeshData merged(const MeshData& a, const MeshData& b) {
  MeshData mesh = a;
  const auto shift = static_cast<uint32_t>(a.positions.size());
  append(mesh.positions, b.positions);
  append(mesh.normals, b.normals);
  append(mesh.texcoords, b.texcoords);
  append(mesh.colors, b.colors);
  for (const auto& t : b.triangles) {
    mesh.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  }
  return mesh;
}

MeshData translated(MeshData mesh, const Vec3& offset) {
  for (Vec3& p : mesh.positions) p += offset;
  return mesh;
}

MeshData scaled(MeshData mesh, float factor) {
  for (Vec3& p : mesh.positions) p *= factor;
  return mesh;
}

MeshData reversed(MeshData mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  for (Vec3& n : mesh.normals) n = -n;
  return mesh;
}

MeshData without_normals(MeshData mesh) {
  mesh.normals.clear();
  return mesh;
}

}  // namespace lightkiln::test
