/* OpenCV's FileStorage for C: lists of names. */
#include <opencv2/core.hpp>
#include <string>

#include "device/replay/names.h"

namespace {

clt_status add_all(const cv::FileNode &list, const char *folder, clt_names *names, clt_error *error) {
  for (const cv::FileNode &item : list) {
    clt_status status = clt_names_add(names, folder, static_cast<std::string>(item).c_str(), error);
    if (status != CLT_OK) {
      return status;
    }
  }
  return CLT_OK;
}

clt_status read_names(const char *path, const char *folder, clt_names *names, clt_error *error) {
  cv::FileStorage file;
  if (!file.open(path, cv::FileStorage::READ)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be read as a list of pictures; give a folder or OpenCV's YAML",
                    path);
  }
  cv::FileNode root = file.root();
  if (root.isMap()) {
    for (const cv::FileNode &node : root) {
      if (node.isSeq() && node.size() > 0 && (*node.begin()).isString()) {
        return add_all(node, folder, names, error);
      }
    }
  }
  return clt_fail(error, CLT_BAD_INPUT, "%s: holds no sequence of names", path);
}

} // namespace

clt_status clt_opencv_read_names(const char *path, const char *folder, clt_names *names, clt_error *error) {
  try {
    return read_names(path, folder, names, error);
  } catch (const cv::Exception &exception) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no list of pictures: %s", path, exception.err.c_str());
  } catch (const std::exception &exception) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be read: %s", path, exception.what());
  } catch (...) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be read for an unknown reason", path);
  }
}
