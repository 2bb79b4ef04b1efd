"""Pictures, masks and poses -> training sets that trainers read: YOLO-seg, COCO, label PNGs, and what is in them."""
